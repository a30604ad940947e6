import { describe, expect, test } from "vitest";
import type { Span } from "../../protocol/types";
import { bars, nearest, ticks } from "./layout";

const span = (number: number, device: string, start: number, duration: number, error?: string): Span => ({
  number,
  action_id: `act_${number}`,
  name: `${number}`,
  device,
  start,
  duration,
  ...(error === undefined ? {} : { error }),
});

describe("bars", () => {
  test("are at the scale of the chart, by device", () => {
    const found = bars([span(1, "arm", 0, 2), span(2, "belt", 2, 1), span(3, "arm", 3, 1, "It fails.")], 0, 10, 10);
    expect(found.get("arm")).toMatchObject([
      { x: 0, width: 20, failed: false },
      { x: 30, width: 10, failed: true },
    ]);
    expect(found.get("belt")?.[0]?.span?.number).toBe(2);
  });

  test("outside of the visible time are left out", () => {
    const spans = Array.from({ length: 100 }, (_, n) => span(n, "arm", n, 0.9));
    expect(bars(spans, 10, 19.5, 10).get("arm")).toHaveLength(10);
  });

  test("below a pixel are joined, so that a long run has few", () => {
    const spans = Array.from({ length: 10_000 }, (_, n) => span(n, "arm", n * 0.01, 0.009));
    const row = bars(spans, 0, 100, 3).get("arm") ?? [];
    expect(row).toHaveLength(1);
    expect(row[0]).toMatchObject({ x: 0, failed: false });
    expect(row[0]?.span).toBeUndefined();
    expect(row[0]?.width).toBeGreaterThan(299);
    expect(row[0]?.width).toBeLessThan(302);
  });

  test("next to a short one keep their action", () => {
    const row = bars([span(1, "arm", 0, 0.001), span(2, "arm", 0.001, 2)], 0, 10, 10).get("arm");
    expect(row?.map((bar) => bar.span?.number)).toEqual([1, 2]);
  });

  test("that fail are not hidden in others", () => {
    const spans = [span(1, "arm", 0, 0.01), span(2, "arm", 0.01, 0.01, "It fails."), span(3, "arm", 0.02, 0.01)];
    expect(
      bars(spans, 0, 1, 10)
        .get("arm")
        ?.map((bar) => bar.failed),
    ).toEqual([false, true, false]);
  });
});

test("marks are at round times with enough space", () => {
  expect(ticks(0, 17, 18, 60)).toEqual([0, 5, 10, 15]);
  expect(ticks(1.2, 2.1, 300, 60)).toEqual([1.2, 1.4, 1.6, 1.8, 2].map((each) => expect.closeTo(each)));
});

test("a tap finds the action under it, or one next to it", () => {
  const spans = [span(1, "arm", 0, 2), span(2, "arm", 2.5, 0.001), span(3, "belt", 2, 1)];
  expect(nearest(spans, "arm", 1, 0.3)?.number).toBe(1);
  expect(nearest(spans, "arm", 2.6, 0.3)?.number).toBe(2);
  expect(nearest(spans, "belt", 2.6, 0.3)?.number).toBe(3);
  expect(nearest(spans, "arm", 9, 0.3)).toBeUndefined();
});
