import { beforeEach, expect, test, vi } from "vitest";
import { View } from "./camera";

const changed = vi.fn();
let element: EventTarget;
let view: View;

/** Press or release a key over the view. */
function key(type: "keydown" | "keyup", code: string, more = {}): void {
  element.dispatchEvent(Object.assign(new Event(type), { code, ...more }));
}

/** Fly for a time, s, and return the movement of the camera. */
function flown(seconds = 0.1): number[] {
  const before = view.camera.position.clone();
  view.fly(seconds);
  return view.camera.position.clone().sub(before).toArray();
}

beforeEach(() => {
  element = Object.assign(new EventTarget(), {
    style: {},
    ownerDocument: new EventTarget(),
    getRootNode: () => new EventTarget(),
  });
  view = new View(element as HTMLElement, changed);
  view.set([0, -2, 1], [0, 0, 1]);
  view.setMode("fly");
  changed.mockClear();
});

test.each([
  ["KeyW", [0, 0.08, 0]],
  ["KeyS", [0, -0.08, 0]],
  ["KeyA", [-0.08, 0, 0]],
  ["KeyD", [0.08, 0, 0]],
  ["KeyE", [0, 0, 0.08]],
  ["KeyQ", [0, 0, -0.08]],
])("%s flies while it is held, by key and by button", (code, movement) => {
  const expected = movement.map((value) => expect.closeTo(value));
  key("keydown", code);
  expect(changed).toHaveBeenCalled(); // a frame is drawn, which moves the camera
  expect(flown()).toEqual(expected);
  key("keyup", code);
  expect(flown()).toEqual([0, 0, 0]);
  view.hold(code, true);
  expect(flown()).toEqual(expected);
  view.hold(code, false);
  expect(flown()).toEqual([0, 0, 0]);
});

test("flying ends when the view loses the focus; shortcuts of the browser do not fly", () => {
  key("keydown", "KeyW");
  element.dispatchEvent(new Event("blur"));
  expect(flown()).toEqual([0, 0, 0]);
  key("keydown", "KeyS", { ctrlKey: true });
  expect(flown()).toEqual([0, 0, 0]);
});

test("after a pause between two frames, the camera does not jump", () => {
  key("keydown", "KeyW");
  expect(flown(5)).toEqual(flown(0.1).map((value) => expect.closeTo(value)));
});
