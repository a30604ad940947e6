import { beforeEach, expect, test, vi } from "vitest";
import { DeadlineExceeded } from "../protocol/errors";

const call = vi.fn();
vi.mock("./connection", () => ({ call, serves: (request: string) => request === "GetViewState" }));

const { Session } = await import("./session");
const { getState, setConnection, store } = await import("../store/store");

beforeEach(() => {
  vi.stubGlobal("window", new EventTarget());
  vi.stubGlobal("document", new EventTarget());
});

/** Create a session, and open its connection as a user. */
function enter(user: string) {
  const client = { stop: vi.fn(), start: vi.fn(), reconnect: vi.fn(), onState: (..._: [string, string, number]) => {} };
  new Session(client as never);
  setConnection({ user });
  client.onState("open", "", 0);
  return client;
}

test("joining sends a request again if the server does not answer it in time", async () => {
  call.mockImplementation((request: string) =>
    request === "SubscribeEvents"
      ? Promise.reject(new DeadlineExceeded(request, 15))
      : Promise.resolve(request === "SystemInfo" ? { supported_rpc_requests: [] } : []),
  );
  const client = enter("Olga");
  await vi.waitFor(() => expect(client.reconnect).toHaveBeenCalledOnce());
  expect(client.reconnect.mock.calls[0]?.[0]).toContain("SubscribeEvents");
  expect(client.stop, "the user has not been refused").not.toHaveBeenCalled();
});

test("settings that a user sees and changes are never replaced by the stored view state", async () => {
  const answers: ((values: object) => void)[] = [];
  call.mockImplementation((request: string) => {
    if (request === "GetViewState") return new Promise((resolve) => answers.push((values) => resolve({ values })));
    return Promise.resolve(request === "SystemInfo" ? { supported_rpc_requests: [] } : []);
  });
  enter("Olga");
  await vi.waitFor(() => expect(answers).toHaveLength(2));
  await new Promise((resolve) => setTimeout(resolve));
  expect(getState().connection.status).toBe("joining");
  for (const answer of answers) answer({ dismissed_run: 3 });
  await vi.waitFor(() => expect(getState().connection.status).toBe("ready"));
  expect(getState().view.general).toEqual({ dismissed_run: 3 });
  await new Promise((resolve) => setTimeout(resolve));
  expect(answers, "requested again while the user may change it").toHaveLength(2);
});

test("a user who goes to another workplace releases own locks before the connection ends", async () => {
  const sent: string[] = [];
  call.mockImplementation((request: string, { object_id }: { object_id: string }) => {
    sent.push(`${request} ${object_id}`);
    return Promise.resolve();
  });
  const client = { stop: () => sent.push("stop"), start: vi.fn(), reconnect: vi.fn() };
  const session = new Session(client as never);
  setConnection({ user: "Olga" });
  store.setState({ locks: { robot: "Olga", tester: "Petr" } });
  await session.releaseLocksAndLeave();
  expect(sent).toEqual(["WriteUnlock robot", "stop"]);
  expect(getState().connection.status).toBe("left");
});
