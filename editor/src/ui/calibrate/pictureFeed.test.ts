import { expect, test } from "vitest";
import { type Feed, followCamera, PERIOD, type Source, staleness } from "./pictureFeed";

/** A camera whose pictures, drawing and time the test controls. */
function camera(of: Partial<Source> = {}) {
  const log: string[] = [];
  const feeds: Feed[] = [];
  const shown = { now: 1000, seen: true, asked: 0, drawing: Promise.resolve() };
  const waits: number[] = [];
  let resume = () => {};
  const end = followCamera({
    take: async () => {
      log.push("take");
      shown.asked++;
      shown.now += 20;
      return new Blob();
    },
    draw: () => {
      log.push("draw");
      return shown.drawing;
    },
    isSeen: () => shown.seen,
    reason: (error) => (error as Error).message,
    changed: (feed) => feeds.push(feed),
    clock: () => shown.now,
    wait: (seconds) => {
      waits.push(seconds);
      shown.now += seconds * 1000;
      return new Promise((resolve) => {
        resume = resolve;
      });
    },
    ...of,
  });
  /** Let the pause end, and everything that follows happen. */
  const next = async () => {
    resume();
    for (let turn = 0; turn < 10; turn++) await Promise.resolve();
  };
  return { log, feeds, waits, shown, next, end };
}

test("the next picture is requested when the previous one was drawn, at most ten times a second", async () => {
  const { log, feeds, waits, shown, next, end } = camera();
  await next();
  expect(log).toEqual(["take", "draw"]);
  expect(waits).toEqual([PERIOD - 0.02]);
  for (let count = 0; count < 5; count++) await next();
  expect(feeds.at(-1)?.rate).toBeCloseTo(10);

  let drawn = () => {};
  shown.drawing = new Promise((resolve) => {
    drawn = resolve;
  });
  const asked = shown.asked;
  for (let count = 0; count < 5; count++) await next();
  expect(shown.asked).toBe(asked + 1);
  drawn();
  shown.drawing = Promise.resolve();
  await next();
  await next();
  expect(shown.asked).toBe(asked + 2);

  end();
  for (let count = 0; count < 5; count++) await next();
  expect(shown.asked).toBe(asked + 2);
});

test("nothing is requested while nobody can see the picture", async () => {
  const { shown, feeds, next } = camera();
  await next();
  shown.seen = false;
  const { asked } = shown;
  for (let count = 0; count < 20; count++) await next();
  expect(shown.asked).toBe(asked);
  shown.seen = true;
  await next();
  expect(shown.asked).toBe(asked + 1);
  expect(feeds.at(-1)?.rate).toBeUndefined();
});

test("after a failure the old picture shows its age, and the camera is tried less and less often", async () => {
  const wrong = { now: false };
  const take = async () => {
    if (wrong.now) throw new Error("No answer.");
    return new Blob();
  };
  const { feeds, waits, next } = camera({ take });
  await next();
  expect(feeds.at(-1)).toEqual({ taken: 1000, failure: "" });
  wrong.now = true;
  waits.length = 0;
  for (let count = 0; count < 4; count++) await next();
  expect(waits).toEqual([1, 2, 4, 4]);
  const feed = feeds.at(-1);
  expect(feed).toEqual({ taken: 1000, failure: "No answer." });
  expect(staleness(feed ?? { failure: "" }, 8000)).toBe(7);
  wrong.now = false;
  await next();
  expect(feeds.at(-1)?.failure).toBe("");
});

test("a picture is marked if no newer one comes", () => {
  expect(staleness({ failure: "" }, 9000)).toBe(0);
  expect(staleness({ failure: "", taken: 8000 }, 9000)).toBe(0);
  expect(staleness({ failure: "", taken: 1000 }, 9000)).toBe(8);
});
