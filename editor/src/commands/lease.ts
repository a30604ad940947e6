/**
 * Hold-to-run with a deadman timeout: a lease that is renewed until release, and ends by itself without renewal. A
 * lease that has ended never starts again.
 */

/** Arguments of a lease in JogRobot and HoldHandTeaching; times in ms. */
export interface LeaseRequest {
  hold: number;
  sent_ms: number;
  valid_ms: number;
}

/** Period of the renewals, and duration of each, ms. */
export const RENEW = 100;
export const VALID = 300;

export class Lease {
  /**
   * Resolves when the robot is at standstill or its state is unknown, with the reason if the lease was not released.
   */
  readonly over: Promise<string>;
  private timer: ReturnType<typeof setInterval> | undefined;
  private state: "new" | "held" | "over" = "new";
  private resolve: (reason: string) => void = () => {};

  /** `hold`: its number, larger than those of earlier leases of this page. */
  constructor(
    private readonly hold: number,
    private readonly send: (request: LeaseRequest) => Promise<unknown>,
    private readonly clock: () => number = () => performance.now(),
  ) {
    this.over = new Promise((resolve) => {
      this.resolve = resolve;
    });
  }

  get held(): boolean {
    return this.state === "held";
  }

  /** Start, unless it was released before. */
  begin(): void {
    if (this.state !== "new") return;
    this.state = "held";
    this.renew();
    this.timer = setInterval(() => this.renew(), RENEW);
  }

  /** Release. Has no effect when it is over. */
  end(): void {
    if (this.state === "over") return;
    const begun = this.state === "held";
    this.finish();
    if (!begun) {
      this.resolve("");
      return;
    }
    // Refused after it ended by itself, or lost with the connection; in both cases the server ends it.
    this.request(0).then(
      () => this.resolve(""),
      () => this.resolve(""),
    );
  }

  private finish(): void {
    this.state = "over";
    clearInterval(this.timer);
  }

  private renew(): void {
    this.request(VALID).catch((error: unknown) => {
      if (this.state !== "held") return;
      this.finish();
      this.resolve(error instanceof Error ? error.message : String(error));
    });
  }

  private async request(valid_ms: number): Promise<unknown> {
    return this.send({ hold: this.hold, sent_ms: this.clock(), valid_ms });
  }
}
