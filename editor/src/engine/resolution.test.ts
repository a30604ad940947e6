import { PerspectiveCamera } from "three";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Resolution } from "./resolution";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

function view(changes = true) {
  const camera = new PerspectiveCamera();
  const sizes: string[] = [];
  const draw = vi.fn();
  const resolution = new Resolution(changes, (width, height) => sizes.push(`${width}x${height}`), draw);
  resolution.resize(800, 600);
  const frame = (x: number, time: number) => {
    camera.position.x = x;
    camera.updateMatrixWorld();
    resolution.follow(camera, time);
    return sizes.at(-1);
  };
  return { frame, draw, resolution };
}

test("while the camera moves at low quality, a quarter of the pixels is drawn, and all of them when it rests", () => {
  const { frame, draw, resolution } = view();
  frame(0, 1000);
  expect(frame(1, 2000)).toBe("800x600"); // a jump
  expect(frame(2, 2030)).toBe("400x300");
  expect([frame(2, 2060), resolution.moving]).toEqual(["400x300", false]);
  expect([frame(3, 2090), resolution.moving]).toEqual(["400x300", true]);
  expect(draw).not.toHaveBeenCalled();
  vi.advanceTimersByTime(300);
  expect(draw).toHaveBeenCalledTimes(1);
  expect([frame(3, 2400), resolution.moving]).toEqual(["800x600", false]);
  vi.advanceTimersByTime(1000);
  expect(draw).toHaveBeenCalledTimes(1);
});

test("at high quality, and for a picture, everything is drawn", () => {
  const high = view(false);
  high.frame(1, 1000);
  expect(high.frame(2, 1030)).toBe("800x600");
  const low = view();
  low.frame(1, 1000);
  expect(low.frame(2, 1030)).toBe("400x300");
  low.resolution.full();
  expect(low.frame(2, 1040)).toBe("800x600");
});
