/** Repeats operations that fail while the server is disconnected, such as loading a part of the page. */

/** Delays before each further attempt, s; the last one is repeated. */
const PAUSES = [0.5, 1, 2, 4];

/** Call `load` until it succeeds, and return its result. */
export async function persistently<T>(load: () => Promise<T>): Promise<T> {
  for (let attempt = 0; ; attempt++) {
    try {
      return await load();
    } catch {
      const pause = PAUSES[Math.min(attempt, PAUSES.length - 1)] ?? 1;
      await new Promise((resolve) => setTimeout(resolve, pause * 1000));
    }
  }
}
