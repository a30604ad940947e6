import { Matrix4, Vector3 } from "three";
import { afterEach, expect, test, vi } from "vitest";
import type { Vec3 } from "./geometry";
import { looking } from "./testing";
import { workplaceIn } from "./xrView";
import { XrWorkplace } from "./xrWorkplace";

afterEach(() => {
  vi.unstubAllGlobals();
});

const POINTS: Vec3[] = [
  [0, 0, 0],
  [0.4, 0, 0],
];
const CAMERA = new Matrix4().makeRotationX(-0.5).setPosition(0, 1.4, 0);
const AT = workplaceIn(looking([0.2, -0.8, 0.6], [0.2, 0, 0]), CAMERA);
const shifted = (by: number) => new Matrix4().makeTranslation(by, 0, 0).multiply(AT);
const shift = (workplace: XrWorkplace) => (workplace.pose?.elements[12] ?? 0) - (AT.elements[12] as number);

/** A frame in which the device is at a place; it has no anchors. */
function moveTo(workplace: XrWorkplace, x: number): void {
  workplace.follow({} as XRFrame, {} as XRReferenceSpace, new Matrix4().makeTranslation(x, 1.4, 0));
}

test("markers correct small errors gradually, and large ones at once and visibly", () => {
  const workplace = new XrWorkplace(POINTS);
  expect(workplace.register(AT, "markers", 0.002, CAMERA)).toBe(0);
  expect(workplace.register(shifted(0.005), "markers", 0.002, CAMERA)).toBe(0);
  expect(shift(workplace)).toBeCloseTo(0.0015, 6);
  expect(workplace.register(shifted(0.05), "markers", 0.002, CAMERA)).toBeCloseTo(0.0485, 4);
  expect(shift(workplace)).toBeCloseTo(0.05, 6);
});

test("a rough sighting does not replace a better registration, until the drift is larger", () => {
  const workplace = new XrWorkplace(POINTS);
  moveTo(workplace, 0);
  workplace.register(AT, "markers", 0.002, CAMERA);
  workplace.register(shifted(0.02), "markers", 0.03, CAMERA);
  expect(shift(workplace)).toBeCloseTo(0, 6);
  expect(workplace.drifted).toBe(false);
  moveTo(workplace, 2);
  expect(workplace.error).toBeCloseTo(Math.hypot(0.002, 0.02), 6);
  expect(workplace.drifted).toBe(true);
  workplace.register(shifted(0.02), "markers", 0.03, CAMERA);
  expect(shift(workplace)).toBeCloseTo(0.02, 6);
  expect(workplace.drifted).toBe(false);
});

test("a workplace that is placed by hand is upright on the surface, and lost with the frame of the session", () => {
  const workplace = new XrWorkplace([]);
  workplace.place(new Matrix4().makeTranslation(0.3, 0.7, -1), CAMERA);
  const up = new Vector3(0, 0, 1).transformDirection(workplace.pose as Matrix4);
  expect(up.toArray()).toEqual([expect.closeTo(0), expect.closeTo(1), expect.closeTo(0)]);
  expect(new Vector3().setFromMatrixPosition(workplace.pose as Matrix4).toArray()).toEqual([0.3, 0.7, -1]);
  expect(workplace.reset()).toBe(true);
  expect(workplace.pose).toBeNull();
});

/** A device with anchors: `drift` is how far its frame has moved away from the room, m. */
class Device {
  drift = 0;
  tracked = true;
  private readonly made: Matrix4[] = [];

  constructor() {
    vi.stubGlobal(
      "XRRigidTransform",
      class {
        readonly matrix;
        constructor({ x = 0, y = 0, z = 0 }) {
          this.matrix = new Matrix4().makeTranslation(x, y, z).elements;
        }
      },
    );
  }

  get anchors(): number {
    return this.made.length;
  }

  /** Show a frame to a workplace. */
  async frame(workplace: XrWorkplace): Promise<void> {
    const frame = {
      createAnchor: async ({ matrix }: XRRigidTransform) => {
        this.made.push(new Matrix4().makeTranslation(-this.drift, 0, 0).multiply(new Matrix4().fromArray(matrix)));
        return { anchorSpace: this.made.length - 1, delete: () => {} };
      },
      getPose: (anchor: number) =>
        this.tracked && {
          transform: {
            matrix: new Matrix4().makeTranslation(this.drift, 0, 0).multiply(this.made[anchor] as Matrix4).elements,
          },
        },
    };
    workplace.follow(frame as unknown as XRFrame, {} as XRReferenceSpace, CAMERA);
    await Promise.resolve(); // the anchor is created after the frame
    await Promise.resolve();
  }
}

test("an anchor holds the workplace while the tracking drifts, until markers correct it", async () => {
  const [workplace, device] = [new XrWorkplace(POINTS), new Device()];
  workplace.register(AT, "markers", 0.002, CAMERA);
  await device.frame(workplace);
  expect(device.anchors).toBe(1);
  expect(shift(workplace)).toBeCloseTo(0, 6);
  // The frame of the device drifts: the workplace stays where the anchor is in the room.
  device.drift = 0.03;
  await device.frame(workplace);
  expect(shift(workplace)).toBeCloseTo(0.03, 6);
  // The anchor is 20 mm off by the markers: they win, also in the frames after.
  expect(workplace.register(shifted(0.05), "markers", 0.002, CAMERA)).toBeCloseTo(0.02, 4);
  await device.frame(workplace);
  expect(shift(workplace)).toBeCloseTo(0.05, 6);
  // Without a marker in sight, the anchor holds the corrected pose.
  device.drift = 0.04;
  await device.frame(workplace);
  expect(shift(workplace)).toBeCloseTo(0.06, 6);
  // An anchor that is lost for a moment leaves it where it was; it is not created again.
  device.tracked = false;
  device.drift = 0.1;
  await device.frame(workplace);
  expect(shift(workplace)).toBeCloseTo(0.06, 6);
  expect(device.anchors).toBe(1);
  // The device has moved the origin of its frame; the anchor still has the pose of the workplace.
  expect(workplace.reset()).toBe(false);
  device.tracked = true;
  device.drift = -0.5;
  await device.frame(workplace);
  expect(shift(workplace)).toBeCloseTo(-0.48, 6);
});
