import { beforeEach, expect, test, vi } from "vitest";
import type { Ar } from "../store/ui";

interface Options {
  report: (state: Partial<Ar>) => void;
  ended: () => void;
}
const sessions: Options[] = [];
const endHolds = vi.fn();
vi.mock("./holdToRun", () => ({ endHolds }));
vi.mock("../session/engine", () => ({ theEngine: () => ({}) }));
vi.mock("./operation", () => ({ stopMotion: async () => {} }));
vi.mock("../ar/gyro", () => ({ askForMotion: async () => {} }));
vi.mock("../ar/arSession", () => ({
  openCamera: async () => ({}),
  releaseCamera: () => {},
  ArSession: class {
    constructor(_stream: unknown, options: Options) {
      sessions.push(options);
    }
    start = async () => {};
    stop = () => {};
  },
}));
const { leaveAr, startAr } = await import("./ar");

async function started(): Promise<Options> {
  await startAr({ places: new Map() } as never, "camera", () => {});
  endHolds.mockClear();
  return sessions.at(-1) as Options;
}

beforeEach(() => vi.stubGlobal("window", {}));

test("a held motion ends when AR is left or the camera ends", async () => {
  await started();
  leaveAr();
  expect(endHolds).toHaveBeenCalledTimes(1);
  leaveAr();
  expect(endHolds).toHaveBeenCalledTimes(1);
  (await started()).ended();
  expect(endHolds).toHaveBeenCalledTimes(1);
});

test("a held motion ends once when the markers are lost, not while the motion sensor replaces them", async () => {
  const { report } = await started();
  for (const phase of ["registered", "bridging", "registered"] as const) report({ phase });
  expect(endHolds).not.toHaveBeenCalled();
  report({ phase: "lost" });
  report({ phase: "lost" });
  expect(endHolds).toHaveBeenCalledTimes(1);
});
