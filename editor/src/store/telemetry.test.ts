import { describe, expect, test } from "vitest";
import { Telemetry } from "./telemetry";

function at(): { telemetry: Telemetry; go: (seconds: number) => void } {
  let time = 100;
  return { telemetry: new Telemetry(() => time), go: (seconds) => (time += seconds) };
}
const joints = (value: number) => ({ robot_id: "r", joints: [{ name: "j", value }] });

describe("joints", () => {
  test("are interpolated between the last two samples and settle at the last one", () => {
    const { telemetry, go } = at();
    telemetry.takeJoints(joints(0));
    go(0.1);
    telemetry.takeJoints(joints(1));
    expect(telemetry.interpolated("r")).toEqual({ joints: new Map([["j", 0]]), settled: false });
    go(0.05);
    expect(telemetry.interpolated("r")?.joints.get("j")).toBeCloseTo(0.5);
    go(0.06);
    expect(telemetry.interpolated("r")).toEqual({ joints: new Map([["j", 1]]), settled: true });
  });

  test("are interpolated over the time between their measurements, also if they arrive late", () => {
    const { telemetry, go } = at();
    telemetry.takeJoints({ ...joints(0), time_ms: 5000 });
    go(0.002);
    telemetry.takeJoints({ ...joints(1), time_ms: 5100 });
    go(0.025);
    expect(telemetry.interpolated("r")?.joints.get("j")).toBeCloseTo(0.25);
  });

  test("are not interpolated after a pause", () => {
    const { telemetry, go } = at();
    telemetry.takeJoints(joints(0));
    go(5);
    telemetry.takeJoints(joints(1));
    expect(telemetry.interpolated("r")).toEqual({ joints: new Map([["j", 1]]), settled: true });
  });

  test("of a robot at standstill are settled, at any rate of samples", () => {
    const { telemetry, go } = at();
    telemetry.takeJoints(joints(1));
    go(0.03);
    telemetry.takeJoints(joints(1.00005));
    expect(telemetry.interpolated("r")).toEqual({ joints: new Map([["j", 1.00005]]), settled: true });
    go(0.03);
    telemetry.takeJoints(joints(1.001));
    expect(telemetry.interpolated("r")?.settled).toBe(false);
  });

  test("that arrive as often as frames are drawn are drawn at once", () => {
    const { telemetry, go } = at();
    telemetry.takeJoints(joints(0));
    go(1 / 30);
    telemetry.takeJoints(joints(1));
    expect(telemetry.interpolated("r", 1 / 30)).toEqual({ joints: new Map([["j", 1]]), settled: true });
    expect(telemetry.interpolated("r", 1 / 60)?.settled).toBe(false);
  });

  test("become outdated, and are cleared when the scene goes offline", () => {
    const { telemetry, go } = at();
    expect(telemetry.age("r")).toBe(Infinity);
    telemetry.takeJoints(joints(0));
    go(2);
    expect(telemetry.age("r")).toBeCloseTo(2);
    const ids: string[] = [];
    const end = telemetry.subscribe((id) => ids.push(id));
    telemetry.clear();
    expect(ids).toEqual(["r"]);
    expect(telemetry.interpolated("r")).toBeUndefined();
    end();
    telemetry.takeJoints(joints(1));
    expect(ids).toEqual(["r"]);
  });
});
