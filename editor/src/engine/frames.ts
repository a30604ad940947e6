/** Schedule frames: one after each request, at low quality not more often than the period. */

export class Frames {
  private scheduled = 0;
  private last = 0;
  /** Earliest time of the next frame, ms. */
  private due = 0;
  /** Whether frames are drawn by `step` only: a headset or tablet in AR requests them at its own pace. */
  driven = false;

  /** `period` is the time between two frames, s; `frame` draws one and returns whether another one is needed. */
  constructor(
    private readonly period: number,
    private readonly limited: boolean,
    private readonly frame: (seconds: number) => boolean,
  ) {}

  /** Number of the requested frame; 0 without one. */
  get pending(): number {
    return this.scheduled;
  }

  request(): void {
    if (this.driven) return;
    this.scheduled ||= requestAnimationFrame((time) => this.run(time));
  }

  /** Draw a frame now, after a time, s. */
  step(seconds: number): void {
    this.frame(seconds);
  }

  dispose(): void {
    cancelAnimationFrame(this.scheduled);
  }

  private run(time: number): void {
    this.scheduled = 0;
    if (this.driven) return;
    if (this.limited && time < this.due - 3) return this.request();
    const seconds = (time - this.last) / 1000;
    this.last = time;
    // A late frame does not delay the next one.
    const period = this.period * 1000;
    this.due = Math.max(this.due + period, time + period / 2);
    if (this.frame(seconds)) this.request();
  }
}
