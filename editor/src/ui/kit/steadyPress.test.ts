import { expect, test } from "vitest";
import { movedAway } from "./steadyPress";

const below = { left: 0, right: 100, top: 300, bottom: 350 };
const pressed = { clientX: 50, clientY: 120 };

test("a button that moved below a finger that stayed", () => {
  expect(movedAway(pressed, { clientX: 54, clientY: 124 }, below)).toBe(true);
});

test("a finger that moved off the button cancels the press", () => {
  expect(movedAway(pressed, { clientX: 50, clientY: 220 }, below)).toBe(false);
});

test("a button that is still below the finger is clicked by the browser", () => {
  expect(movedAway(pressed, pressed, { left: 0, right: 100, top: 100, bottom: 150 })).toBe(false);
});
