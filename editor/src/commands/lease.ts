/**
 * A motion that lasts as long as it is held: a lease that is renewed again and again, and ends by itself when nothing
 * renews it. Nothing here begins anew what has ended.
 */

/** How a lease is asked for: in ms, as JogRobot and HoldHandTeaching take it. */
export interface LeaseRequest {
  hold: number;
  sent_ms: number;
  valid_ms: number;
}

/** ms between renewals, and for which each of them holds. */
export const RENEW = 100;
export const VALID = 300;

let numberOfHold = 0;

export class Lease {
  /** Resolves when it is over and the robot stands, or is no longer known; with why, where it was not simply let go. */
  readonly over: Promise<string>;
  private readonly hold = ++numberOfHold;
  private timer: ReturnType<typeof setInterval> | undefined;
  private state: "new" | "held" | "over" = "new";
  private resolve: (reason: string) => void = () => {};

  constructor(
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

  /** Begin, unless it was let go before. */
  begin(): void {
    if (this.state !== "new") return;
    this.state = "held";
    this.renew();
    this.timer = setInterval(() => this.renew(), RENEW);
  }

  /** Let go. Does nothing when it is over. */
  end(): void {
    if (this.state === "over") return;
    const begun = this.state === "held";
    this.finish();
    if (!begun) {
      this.resolve("");
      return;
    }
    // Refused when it had ended by itself, lost with the connection: in both cases the server ends it.
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
