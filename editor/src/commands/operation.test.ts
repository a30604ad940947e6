import { beforeEach, expect, test, vi } from "vitest";

const call = vi.fn();
vi.mock("../session/connection", () => ({ call, serves: () => true }));
const endHolds = vi.fn();
vi.mock("./holdToRun", () => ({ endHolds }));
const notify = vi.fn();
vi.mock("../store/store", () => ({ notify, now: () => ({}) }));
const { stopMotion } = await import("./operation");

beforeEach(() => vi.clearAllMocks());

test("Stop sends one request, ends holds at once, and reports nothing if everything was stopped", async () => {
  let answer: (data: object) => void = () => {};
  call.mockReturnValue(new Promise((done) => (answer = done)));
  const stopped = stopMotion();
  expect(call.mock.calls.map(([request]) => request)).toEqual(["StopAll"]);
  expect(endHolds).toHaveBeenCalledOnce();
  answer({ outcomes: [{ kind: "device", id: "obj_1", name: "ur5e", stopped: true }] });
  await stopped;
  expect(notify).not.toHaveBeenCalled();
});

test("What was not stopped is named, with what to do", async () => {
  const reason = "press: run cannot be stopped from here";
  call.mockResolvedValue({
    outcomes: [
      { kind: "device", id: "obj_1", name: "ur5e", stopped: true },
      { kind: "action", id: "act_1", name: "press_1", stopped: false, reason },
    ],
  });
  await stopMotion();
  expect(notify).toHaveBeenCalledWith("error", `Not stopped: ${reason}. Use the emergency stop.`);
});

test("A stop that could not be sent is told", async () => {
  call.mockRejectedValue(new Error("The connection is lost."));
  await stopMotion();
  expect(notify).toHaveBeenCalledWith("error", "Not stopped: The connection is lost. Use the emergency stop.");
});
