/** Asks how the robot would stand at a goal that is dragged: of the newest goal alone, one question at a time. */

import { type Chosen, effectorPose, showAt } from "../../commands/robot";
import type { WayState } from "../../engine/way";
import type { Pose } from "../../protocol/types";
import { metBy } from "../../session/lines";

/** ms between two questions. */
export const PAUSE = 100;

export interface GoalAnswer {
  /** What it is the answer to. */
  goal: Pose;
  /** What stands against the goal; empty when nothing does. */
  problem: string;
  /** How the straight way there is, and the id of what stands in it. */
  way: WayState;
  met: string;
}

export class LiveGoal {
  private wanted: Pose | null = null;
  private busy = false;
  private ended = false;
  private last = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** `straight`: whether the robot would go straight there, so that the way can be looked at. */
  constructor(
    private readonly chosen: Chosen,
    private readonly straight: () => boolean,
    private readonly told: (answer: GoalAnswer) => void,
  ) {}

  ask(goal: Pose): void {
    this.wanted = goal;
    this.next();
  }

  /** Ask no more of what is not asked yet, and show nothing of what is. */
  forget(): void {
    this.wanted = null;
    this.ended = true;
  }

  private next(): void {
    if (this.busy || this.timer !== undefined || !this.wanted) return;
    this.timer = setTimeout(
      () => {
        this.timer = undefined;
        void this.one();
      },
      Math.max(0, this.last + PAUSE - performance.now()),
    );
  }

  private async one(): Promise<void> {
    const goal = this.wanted;
    if (!goal) return;
    this.wanted = null;
    this.busy = true;
    this.ended = false;
    this.last = performance.now();
    const current = () => !this.ended;
    const problem = await showAt(this.chosen, goal, { current, keep: true });
    const from = effectorPose(this.chosen);
    let way: WayState = "unknown";
    let met = "";
    if (from && this.straight() && current()) {
      const found = await metBy(from.position, goal.position).catch(() => undefined);
      if (found !== undefined) [way, met] = [found === null ? "free" : "blocked", found ?? ""];
    }
    this.busy = false;
    if (current()) this.told({ goal, problem, way: problem ? "blocked" : way, met });
    this.next();
  }
}
