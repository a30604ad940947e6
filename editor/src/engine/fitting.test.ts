import { BoxGeometry, Group, Mesh, PerspectiveCamera, type Vector3 } from "three";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { View } from "./camera";
import { Fitting } from "./fitting";
import type { Item } from "./items";
import { ownedBy, type Thing } from "./thing";

function thing(id: string, x: number): [string, Thing] {
  const root = new Group();
  root.add(new Mesh(new BoxGeometry(0.1, 0.1, 0.1)));
  root.position.x = x;
  ownedBy(root, id);
  root.updateMatrixWorld();
  const item = { kind: "object", id, faint: 0 } as Item;
  return [id, { item, root, anchor: (at: Vector3) => at.set(x, 0, 0) } as unknown as Thing];
}

/** A view whose camera moves with the number of points that it fits. */
function workplace() {
  const camera = new PerspectiveCamera();
  const fit = vi.fn((points: readonly Vector3[]) => camera.position.set(points.length, 0, 0));
  const things = new Map([thing("robot", 0)]);
  const fitting = new Fitting({ fit, camera } as unknown as View, things);
  const appear = (id: string) => {
    const [, added] = thing(id, 2);
    things.set(id, added);
    fitting.added(added.item);
    fitting.loaded(id);
  };
  return { camera, fit, fitting, appear };
}

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

test("devices that appear while the workplace loads are framed too", () => {
  const { fit, fitting, appear } = workplace();
  fitting.focus(undefined, true);
  vi.advanceTimersByTime(3000);
  appear("belt");
  expect(fit).toHaveBeenCalledTimes(2);
  expect(fit.mock.lastCall?.[0]).toHaveLength(16);
});

test("the camera does not move by itself later, nor after the user has moved it", () => {
  const { camera, fit, fitting, appear } = workplace();
  fitting.focus();
  camera.position.y = 1;
  appear("belt");
  expect(fit).toHaveBeenCalledTimes(1);
  fitting.focus();
  vi.advanceTimersByTime(60_000);
  appear("scale");
  expect(fit).toHaveBeenCalledTimes(2);
});
