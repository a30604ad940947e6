import { beforeEach, expect, test, vi } from "vitest";
import { setTranslations } from "../i18n/testing";

const call = vi.fn();
vi.mock("../session/connection", () => ({ call, serves: () => true }));
const stopHoldToRun = vi.fn();
vi.mock("./holdToRun", () => ({ stopHoldToRun }));
const notify = vi.fn();
vi.mock("../store/store", () => ({ notify, getState: () => ({}) }));
const { stopMotion } = await import("./operation");

beforeEach(() => vi.clearAllMocks());

test("Stop sends one request, ends holds at once, and reports nothing if everything was stopped", async () => {
  let answer: (data: object) => void = () => {};
  call.mockReturnValue(new Promise((done) => (answer = done)));
  const stopped = stopMotion();
  expect(call.mock.calls.map(([request]) => request)).toEqual(["StopAll"]);
  expect(stopHoldToRun).toHaveBeenCalledOnce();
  answer({ outcomes: [{ kind: "device", id: "obj_1", name: "ur5e", stopped: true }] });
  await stopped;
  expect(notify).not.toHaveBeenCalled();
});

test("devices that were not stopped are named with advice", async () => {
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

test("Reasons are shown in the user's language", async () => {
  setTranslations({ "{device}: stop() returned": "{device}: stop() skončil" });
  const reason = { reason: "ur5e: stop() returned", key: "{device}: stop() returned", values: { device: "ur5e" } };
  call.mockResolvedValue({ outcomes: [{ kind: "device", id: "obj_1", name: "ur5e", stopped: false, ...reason }] });
  await stopMotion();
  setTranslations({});
  expect(notify).toHaveBeenCalledWith("error", "Not stopped: ur5e: stop() skončil. Use the emergency stop.");
});

test("a stop that could not be sent is reported", async () => {
  call.mockRejectedValue(new Error("The connection is lost."));
  await stopMotion();
  expect(notify).toHaveBeenCalledWith("error", "Not stopped: The connection is lost. Use the emergency stop.");
});
