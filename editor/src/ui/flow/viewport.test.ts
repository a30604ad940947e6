import { expect, it } from "vitest";
import { firstView, READABLE, type Rect, viewOf } from "./viewport";

const node = (x: number, y: number): Rect => ({ x, y, width: 250, height: 66 });
const SIZE = { width: 800, height: 700 };
const drawn = (box: Rect, { x, y, zoom }: { x: number; y: number; zoom: number }) => ({
  left: box.x * zoom + x,
  right: (box.x + box.width) * zoom + x,
  top: box.y * zoom + y,
  bottom: (box.y + box.height) * zoom + y,
});

it("a short program is shown as a whole", () => {
  const boxes = [node(0, 0), node(0, 110), node(140, 220)];
  const view = firstView(boxes, boxes[0], SIZE);
  for (const box of boxes) {
    const { left, right, top, bottom } = drawn(box, view);
    expect(Math.min(left, top, SIZE.width - right, SIZE.height - bottom)).toBeGreaterThanOrEqual(16);
  }
});

it("a long program opens at its start and at a readable size", () => {
  const boxes = Array.from({ length: 30 }, (_, n) => node(n % 3 === 0 ? 300 : 0, n * 110));
  const view = firstView(boxes, boxes[0], SIZE);
  expect(view.zoom).toBe(READABLE);
  expect(drawn(boxes[0] as Rect, view).top).toBe(70);
  for (const box of boxes) {
    const { left, right } = drawn(box, view);
    expect(Math.min(left, SIZE.width - right)).toBeGreaterThanOrEqual(16); // its whole width is shown
  }
  // Of a graph that is too wide, the start is in the middle.
  const wide = [...boxes, node(2000, 300)];
  const { left, right } = drawn(boxes[0] as Rect, firstView(wide, boxes[0], SIZE));
  expect((left + right) / 2).toBe(SIZE.width / 2);
});

it("a node is brought into the view only if it is not there", () => {
  const view = { x: 0, y: 0, zoom: 1 };
  expect(viewOf(node(100, 100), view, SIZE)).toBeNull();
  const moved = viewOf(node(100, 680), view, SIZE);
  expect(moved?.zoom).toBe(1);
  const { top, bottom } = drawn(node(100, 680), moved ?? view);
  expect([top > 0, bottom < SIZE.height]).toEqual([true, true]);
  // A graph that is shown as a whole is too small to follow.
  expect(viewOf(node(100, 100), { x: 0, y: 0, zoom: 0.2 }, SIZE)).toBeNull();
  expect(viewOf(node(100, 100), { x: 0, y: 0, zoom: 0.2 }, SIZE, true)?.zoom).toBe(READABLE);
});
