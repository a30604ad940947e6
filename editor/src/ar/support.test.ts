import { expect, test } from "vitest";
import { codesOf } from "./codes";
import { layoutOf } from "./places";
import { abilitiesOf, methodsOf, obstacleOf, obstacleOfError } from "./support";

const ABLE = { secure: true, camera: true, workers: true };
const pose = { position: { x: 1, y: 2, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
const one = layoutOf({ markers: [{ marker_id: 7, pose, size: 0.2 }] });

test("the first obstacle is named", () => {
  expect(obstacleOf(ABLE, one)).toBeNull();
  expect(obstacleOf({ ...ABLE, secure: false, camera: false }, one)).toBe("insecure");
  expect(obstacleOf({ ...ABLE, camera: false }, one)).toBe("browser");
  expect(obstacleOf({ ...ABLE, workers: false }, null)).toBe("browser");
  expect(obstacleOf(ABLE, layoutOf({}))).toBe("markers");
  expect(obstacleOf(ABLE, layoutOf({ dictionary: "6x6_50", markers: [{ marker_id: 7, pose }] }))).toBe("dictionary");
  expect(abilitiesOf({ isSecureContext: false } as typeof globalThis)).toEqual({
    secure: false,
    camera: false,
    workers: false,
  });
});

test("errors of the camera are distinguished", () => {
  const named = (name: string) => obstacleOfError(Object.assign(new Error(), { name }));
  expect(["NotAllowedError", "NotReadableError", "NotFoundError"].map(named)).toEqual(["refused", "busy", "missing"]);
});

test("markers have their own or the common size, and ids of their dictionary", () => {
  expect(one.places.get(7)?.corners).toEqual([
    [0.9, 2.1, 0],
    [1.1, 2.1, 0],
    [1.1, 1.9, 0],
    [0.9, 1.9, 0],
  ]);
  expect([...codesOf("4x4_50", [0, 49, 50, -1]).keys()]).toEqual([0, 49]);
  expect(codesOf("4x4_250", [249]).size).toBe(1);
});

test("WebXR is used where the device has it, and the picture of the camera otherwise", async () => {
  const scope = (xr?: { isSessionSupported: (mode: string) => Promise<boolean> }, camera = true) =>
    ({
      isSecureContext: true,
      navigator: { xr, ...(camera && { mediaDevices: { getUserMedia: () => {} } }) },
      OffscreenCanvas: class {},
      createImageBitmap: () => {},
    }) as unknown as typeof globalThis;
  const supports = { isSessionSupported: async (mode: string) => mode === "immersive-ar" };
  expect(await methodsOf(scope())).toEqual(["camera"]);
  expect(await methodsOf(scope(supports))).toEqual(["xr", "camera"]);
  expect(await methodsOf(scope(supports, false))).toEqual(["xr"]);
  expect(await methodsOf(scope({ isSessionSupported: () => Promise.reject(new Error()) }))).toEqual(["camera"]);
  expect(await methodsOf({ ...scope(supports), isSecureContext: false })).toEqual([]);
});
