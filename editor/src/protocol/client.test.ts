import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { ProtocolClient, type Socket } from "./client";
import { ConnectionLost, DeadlineExceeded, Refused } from "./errors";

class FakeSocket implements Socket {
  readyState = 0;
  sent: Record<string, unknown>[] = [];
  closed = false;
  onopen: Socket["onopen"] = null;
  onclose: Socket["onclose"] = null;
  onmessage: Socket["onmessage"] = null;
  send(text: string) {
    this.sent.push(JSON.parse(text) as Record<string, unknown>);
  }
  close() {
    this.closed = true;
    this.readyState = 3;
  }
  opens() {
    this.readyState = 1;
    this.onopen?.();
  }
  says(message: unknown) {
    this.onmessage?.({ data: typeof message === "string" ? message : JSON.stringify(message) });
  }
  breaks(code = 1006) {
    this.readyState = 3;
    this.onclose?.({ code, reason: "" });
  }
}

let sockets: FakeSocket[];
let client: ProtocolClient;
const last = () => sockets[sockets.length - 1] as FakeSocket;

beforeEach(() => {
  vi.useFakeTimers();
  sockets = [];
  client = new ProtocolClient({
    open: () => {
      sockets.push(new FakeSocket());
      return last();
    },
    random: () => 0.5,
  });
});
afterEach(() => {
  client.stop();
  vi.useRealTimers();
});

describe("requests", () => {
  test("are matched to answers by id, in any order", async () => {
    client.start();
    last().opens();
    const one = client.call("GetScene", { id: "a" });
    const two = client.call("GetScene", { id: "b" }, { dryRun: true });
    expect(last().sent).toEqual([
      { id: 1, request: "GetScene", args: { id: "a" }, codes: true },
      { id: 2, request: "GetScene", args: { id: "b" }, dry_run: true, codes: true },
    ]);
    last().says({ id: 2, response: "GetScene", result: true, data: "second" });
    last().says({ id: 1, response: "GetScene", result: false, messages: ["No such scene."], code: "not_found" });
    await expect(two).resolves.toBe("second");
    const error = await one.catch((e: unknown) => e);
    expect(error).toBeInstanceOf(Refused);
    expect(error).toMatchObject({ message: "No such scene.", code: "not_found", request: "GetScene" });
  });

  test("fail at their deadline, and a late answer is ignored", async () => {
    client.start();
    last().opens();
    const late = client.call("ListScenes", undefined, { deadline: 2 }).catch((e: unknown) => e);
    await vi.advanceTimersByTimeAsync(2000);
    expect(await late).toBeInstanceOf(DeadlineExceeded);
    const next = client.call("ListScenes");
    last().says({ id: 1, response: "ListScenes", result: true, data: ["stale"] });
    last().says({ id: 2, response: "ListScenes", result: true, data: [] });
    await expect(next).resolves.toEqual([]);
  });

  test("can be cancelled", async () => {
    client.start();
    last().opens();
    const abort = new AbortController();
    const given = client.call("ListScenes", undefined, { signal: abort.signal }).catch((e: unknown) => e);
    abort.abort(new Error("another question"));
    expect(await given).toMatchObject({ message: "another question" });
  });

  test("fail without a connection and are not repeated after a reconnect", async () => {
    client.start();
    const early = await client.call("StepAction").catch((e: unknown) => e);
    expect(early).toBeInstanceOf(ConnectionLost);
    expect((early as ConnectionLost).sent).toBe(false);
    last().opens();
    const motion = client.call("MoveToJoints", { robot_id: "r", speed: 1, joints: [] }).catch((e: unknown) => e);
    last().breaks();
    const failed = await motion;
    expect(failed).toBeInstanceOf(ConnectionLost);
    expect((failed as ConnectionLost).sent).toBe(true);
    await vi.advanceTimersByTimeAsync(1000);
    last().opens();
    expect(sockets.length).toBe(2);
    expect(last().sent).toEqual([]);
  });
});

describe("the connection", () => {
  test("is restored after increasing delays, up to a limit", async () => {
    const states: string[] = [];
    client.onState = (state) => states.push(state);
    client.start();
    last().opens();
    for (const pause of [200, 400, 800, 1600, 3000, 3000]) {
      last().breaks();
      await vi.advanceTimersByTimeAsync(pause - 1);
      const before = sockets.length;
      await vi.advanceTimersByTimeAsync(1);
      expect(sockets.length).toBe(before + 1);
    }
    last().opens();
    expect(states.slice(0, 4)).toEqual(["connecting", "open", "waiting", "connecting"]);
    expect(client.state).toBe("open");
    last().breaks();
    client.reconnectNow();
    expect(client.state).toBe("connecting");
  });

  test("is closed if the server is silent and does not answer a ping", async () => {
    client.start();
    last().opens();
    await vi.advanceTimersByTimeAsync(4000);
    expect(last().sent).toMatchObject([{ request: "SystemInfo" }]);
    const silent = last();
    await vi.advanceTimersByTimeAsync(3000);
    expect(silent.closed).toBe(true);
    expect(client.state).toBe("waiting");
  });

  test("is kept while events arrive", async () => {
    client.start();
    last().opens();
    for (let i = 0; i < 5; i++) {
      await vi.advanceTimersByTimeAsync(3000);
      last().says({ event: "ProjectSaved" });
    }
    expect(last().sent).toEqual([]);
    expect(client.state).toBe("open");
  });

  test("is not retried with an invalid token", async () => {
    client.start();
    last().opens();
    last().breaks(4401);
    await vi.advanceTimersByTimeAsync(60_000);
    expect(client.state).toBe("closed");
    expect(sockets.length).toBe(1);
  });

  test("is closed by stop", async () => {
    client.start();
    last().opens();
    client.stop();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(sockets.length).toBe(1);
    expect(last().closed).toBe(true);
  });
});

test("events are passed on, and invalid messages are reported", () => {
  const events: unknown[] = [];
  const oddities: string[] = [];
  client.onEvent = (event) => events.push(event);
  client.onInvalidMessage = (text) => oddities.push(text);
  client.start();
  last().opens();
  last().says("{half");
  last().says({ id: 0, response: "Error", result: false, messages: ["no request"] });
  last().says({ event: "SceneSaved" });
  expect(events).toEqual([{ event: "SceneSaved" }]);
  expect(oddities.length).toBe(2);
});
