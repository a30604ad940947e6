import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { Ar } from "../store/ui";

interface Options {
  report: (state: Partial<Ar>) => void;
  ended: () => void;
  stopOutOfReach: () => void;
}
const sessions: Options[] = [];
const stopHoldToRun = vi.fn();
const stopMotion = vi.fn(async () => {});
/** The session of WebXR that the browser starts. */
const requestXr = vi.fn(async (): Promise<object> => ({}));
vi.mock("./holdToRun", () => ({ stopHoldToRun }));
vi.mock("../session/engine", () => ({ theEngine: () => ({}) }));
vi.mock("./operation", () => ({ stopMotion }));
vi.mock("../ar/motionSensor", () => ({ askForMotion: async () => {} }));
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
vi.mock("../ar/xrSession", () => ({
  requestXr,
  hasOverlay: () => false,
  XrArSession: class {
    mode = "headset";
    constructor(_session: unknown, options: Options) {
      sessions.push(options);
    }
    start = async () => {};
    stop = () => {};
  },
}));
const { leaveAr, programEnded, startAr, startHere } = await import("./ar");

async function started(method: "camera" | "xr" = "camera"): Promise<Options> {
  await startAr({ places: new Map() } as never, method, () => {});
  stopHoldToRun.mockClear();
  return sessions.at(-1) as Options;
}

beforeEach(() => {
  vi.stubGlobal("window", {});
  stopMotion.mockClear();
});
afterEach(() => {
  vi.unstubAllGlobals();
});

test("a held motion ends when AR is left or the camera ends", async () => {
  await started();
  leaveAr();
  expect(stopHoldToRun).toHaveBeenCalledTimes(1);
  leaveAr();
  expect(stopHoldToRun).toHaveBeenCalledTimes(1);
  (await started()).ended();
  expect(stopHoldToRun).toHaveBeenCalledTimes(1);
});

test("a held motion ends once when the markers are lost, not while the motion sensor replaces them", async () => {
  const { report } = await started();
  for (const phase of ["registered", "bridging", "registered"] as const) report({ phase });
  expect(stopHoldToRun).not.toHaveBeenCalled();
  report({ phase: "lost" });
  report({ phase: "lost" });
  expect(stopHoldToRun).toHaveBeenCalledTimes(1);
});

test("a program that a headset started stops when no button stops motion any more", async () => {
  const { stopOutOfReach } = await started("xr");
  stopOutOfReach();
  expect(stopHoldToRun).toHaveBeenCalledTimes(1);
  expect(stopMotion).not.toHaveBeenCalled(); // it started none
  await startHere(async () => true);
  expect(stopMotion).not.toHaveBeenCalled();
  stopOutOfReach();
  stopOutOfReach();
  expect(stopMotion).toHaveBeenCalledTimes(1);
});

test("a program of a headset stops when the button is lost while it starts", async () => {
  const { stopOutOfReach } = await started("xr");
  let answer = (_: boolean) => {};
  const running = startHere(
    () =>
      new Promise<boolean>((resolve) => {
        answer = resolve;
      }),
  );
  stopOutOfReach();
  stopMotion.mockClear();
  answer(true);
  await running;
  expect(stopMotion).toHaveBeenCalledTimes(1);
});

test("a program of a headset stops with its session, unless the user leaves AR", async () => {
  const { ended } = await started("xr");
  await startHere(async () => true);
  ended();
  expect(stopMotion).toHaveBeenCalledTimes(1);
  const { stopOutOfReach } = await started("xr");
  await startHere(async () => true);
  leaveAr(); // the page has its own Stop
  stopOutOfReach();
  expect(stopMotion).toHaveBeenCalledTimes(1);
});

test("a headset stops no program that others started", async () => {
  const { stopOutOfReach } = await started("xr");
  await startHere(async () => true);
  programEnded();
  stopOutOfReach();
  await startHere(async () => false); // refused
  stopOutOfReach();
  expect(stopMotion).not.toHaveBeenCalled();
});

test("a session of WebXR that the browser refuses or that hides Stop is not used", async () => {
  const refused = async (name: string) => {
    requestXr.mockRejectedValueOnce(Object.assign(new Error(), { name }));
    return startAr({ places: new Map() } as never, "xr", () => {}).catch((error) => error.obstacle);
  };
  expect(await refused("NotSupportedError")).toBe("session");
  expect(await refused("NotAllowedError")).toBe("refused");
  const end = vi.fn(async () => {});
  requestXr.mockResolvedValueOnce({ interactionMode: "screen-space", end });
  await expect(startAr({ places: new Map() } as never, "xr", () => {})).rejects.toMatchObject({ obstacle: "overlay" });
  expect(end).toHaveBeenCalledTimes(1);
});
