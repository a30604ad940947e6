/** Live pictures of a camera: the next picture is requested when the previous one is drawn and visible. */

/** Shortest time between the requests of two pictures, s. */
export const PERIOD = 0.1;
/** Pauses after failures, s; the last one is repeated. */
const PAUSES = [1, 2, 4];
/** Age from which a picture is marked, s: two pictures of a slow camera. */
const STALE = 3;
/** Period of the check whether the picture can be seen again, s. */
const UNSEEN = 0.25;
/** Number of pictures whose mean rate is shown. */
const MEASURED = 10;

export interface Feed {
  /** When the shown picture was requested, ms; undefined before the first one. */
  taken?: number;
  /** Pictures per second; undefined until two have been drawn in succession. */
  rate?: number;
  /** The reason why there is no new picture; empty if the last request succeeded. */
  failure: string;
}

export interface Source {
  take: () => Promise<Blob>;
  /** Draw a picture; resolve when it is on the screen. */
  draw: (picture: Blob) => Promise<void>;
  /** Whether the place of the picture is visible. */
  isSeen: () => boolean;
  reason: (error: unknown) => string;
  changed: (feed: Feed) => void;
  clock?: () => number;
  wait?: (seconds: number) => Promise<void>;
}

const sleep = (seconds: number) => new Promise<void>((resolve) => setTimeout(resolve, seconds * 1000));

/** Follow a camera until the returned function is called. At most one picture is requested at a time. */
export function followCamera(source: Source): () => void {
  const { take, draw, isSeen, reason, changed, clock = Date.now, wait = sleep } = source;
  let ended = false;
  let feed: Feed = { failure: "" };
  let failures = 0;
  let drawn: number[] = [];
  const one = async (): Promise<number> => {
    const asked = clock();
    try {
      const picture = await take();
      if (ended) return 0;
      await draw(picture);
      failures = 0;
      drawn = [...drawn, clock()].slice(-MEASURED - 1);
      feed = { taken: asked, failure: "", ...rateOf(drawn) };
      return Math.max(0, PERIOD - (clock() - asked) / 1000);
    } catch (error) {
      drawn = [];
      const { rate: _, ...before } = feed;
      feed = { ...before, failure: reason(error) };
      return PAUSES[Math.min(failures++, PAUSES.length - 1)] ?? 1;
    }
  };
  const run = async () => {
    while (!ended) {
      if (!isSeen()) {
        drawn = []; // the time without pictures is not part of the rate
        await wait(UNSEEN);
        continue;
      }
      const pause = await one();
      if (ended) return;
      changed(feed);
      await wait(pause);
    }
  };
  void run();
  return () => {
    ended = true;
  };
}

function rateOf(drawn: readonly number[]): Pick<Feed, "rate"> {
  const [first, last] = [drawn[0], drawn.at(-1)];
  if (first === undefined || last === undefined || last <= first) return {};
  return { rate: ((drawn.length - 1) * 1000) / (last - first) };
}

/** Return the age of a shown picture in s if it has to be marked, otherwise 0. */
export function staleness(feed: Feed, time: number): number {
  const age = feed.taken === undefined ? 0 : (time - feed.taken) / 1000;
  return age >= STALE || (feed.failure !== "" && age > 0) ? age : 0;
}
