import { Matrix4, PerspectiveCamera, Vector3 } from "three";
import { expect, test } from "vitest";
import { projected } from "./pose";
import { looking } from "./testing";
import { cropped, lensIn, viewOf, workplaceIn } from "./xrView";

const CAMERA = new Matrix4().makeRotationY(0.4).setPosition(0.3, 1.5, 0.2);
const VIEW = looking([1, -0.8, 0.9], [0.2, 0.1, 0]);
const POINT = new Vector3(0.25, 0.05, 0.1);

function camera(): PerspectiveCamera {
  const made = new PerspectiveCamera(50, 1180 / 820, 0.05, 100);
  made.projectionMatrix.elements[8] = 0.02; // the principal point of real cameras is not in the middle
  made.projectionMatrix.elements[9] = -0.03;
  return made;
}

test("the workplace is where the picture shows it", () => {
  const workplace = workplaceIn(VIEW, CAMERA);
  const back = viewOf(workplace, CAMERA);
  expect(back.turn.flat()).toEqual(VIEW.turn.flat().map((each) => expect.closeTo(each, 9)));
  expect(back.shift).toEqual(VIEW.shift.map((each) => expect.closeTo(each, 9)));
  // A point is drawn at the pixel at which the lens of the picture expects it.
  const { projectionMatrix } = camera();
  const drawn = POINT.clone()
    .applyMatrix4(workplace)
    .applyMatrix4(CAMERA.clone().invert())
    .applyMatrix4(projectionMatrix);
  const lens = lensIn(projectionMatrix.elements, 1180, 820);
  const [x, y] = projected(POINT.toArray(), VIEW, lens) ?? [0, 0];
  expect([((drawn.x + 1) / 2) * 1180 - 0.5, ((1 - drawn.y) / 2) * 820 - 0.5]).toEqual([
    expect.closeTo(x, 3),
    expect.closeTo(y, 3),
  ]);
});

test("a part of the screen has its part of the projection", () => {
  const { projectionMatrix } = camera();
  const part = { left: 84, top: 60, width: 700, height: 640 };
  const at = new Vector3(0.2, -0.15, -1.4);
  const whole = at.clone().applyMatrix4(projectionMatrix);
  const inPart = at.clone().applyMatrix4(cropped(projectionMatrix, { width: 1180, height: 820 }, part));
  expect(part.left + ((inPart.x + 1) / 2) * part.width).toBeCloseTo(((whole.x + 1) / 2) * 1180, 6);
  expect(part.top + ((1 - inPart.y) / 2) * part.height).toBeCloseTo(((1 - whole.y) / 2) * 820, 6);
});
