import { afterEach, beforeEach, expect, test, vi } from "vitest";

const call = vi.fn((_request: string, _args: { hold: number; valid_ms: number }) => Promise.resolve({}));
vi.mock("../session/connection", () => ({ call }));
vi.mock("./requests", () => ({ withLock: (_id: string, work: () => unknown) => work(), sentence: String }));
const { stopHoldToRun, holdJog } = await import("./holdToRun");
const { setConnection } = await import("../store/store");

const JOG = { axis: "x" } as never;
const released = () => call.mock.calls.filter(([, { valid_ms }]) => valid_ms === 0).map(([, { hold }]) => hold);

beforeEach(() => {
  vi.stubGlobal("window", new EventTarget());
  vi.stubGlobal("document", new EventTarget());
  setConnection({ status: "ready" });
  vi.clearAllMocks();
});
afterEach(() => {
  stopHoldToRun();
  vi.unstubAllGlobals();
});

test("a new hold ends the previous one and has a larger number", () => {
  holdJog("robot", JOG);
  holdJog("robot", JOG);
  const [first, end, second] = call.mock.calls.map(([, args]) => args);
  expect(end).toMatchObject({ hold: first?.hold, valid_ms: 0 });
  expect(second?.hold).toBeGreaterThan(first?.hold ?? Infinity);
});

test("a hold ends when the page loses the focus, is hidden or loses the connection", async () => {
  for (const leave of [
    () => window.dispatchEvent(new Event("blur")),
    () => document.dispatchEvent(new Event("visibilitychange")),
    () => setConnection({ status: "lost" }),
  ]) {
    call.mockClear();
    setConnection({ status: "ready" });
    const { over } = holdJog("robot", JOG);
    leave();
    expect(released()).toHaveLength(1);
    await expect(over).resolves.toBe("");
    leave();
    expect(released()).toHaveLength(1);
  }
});
