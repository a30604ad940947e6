/** Check a target while it is dragged: only the latest one, one request at a time. */

import { effectorPose, type RobotSelection, showGhostAt } from "../../commands/robot";
import type { PathState } from "../../engine/pathLine";
import type { Pose } from "../../protocol/types";
import { obstacleOn } from "../../session/paths";

/** Time between two requests, ms. */
export const PAUSE = 100;

export interface GoalAnswer {
  /** The target that was checked. */
  goal: Pose;
  /** The reason why the target cannot be reached; empty if it can be reached. */
  problem: string;
  /** State of the straight path, and the id of the obstacle. */
  path: PathState;
  obstacle: string;
}

export class LiveGoal {
  private wanted: Pose | null = null;
  private busy = false;
  private ended = false;
  private last = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** `straight`: whether the motion is straight, so that the path can be checked. */
  constructor(
    private readonly chosen: RobotSelection,
    private readonly straight: () => boolean,
    private readonly onAnswer: (answer: GoalAnswer) => void,
  ) {}

  ask(goal: Pose): void {
    this.wanted = goal;
    this.next();
  }

  /** Cancel the waiting request, and ignore the answer of the running one. */
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
    const problem = await showGhostAt(this.chosen, goal, { current, keep: true });
    const from = effectorPose(this.chosen);
    let path: PathState = "unknown";
    let obstacle = "";
    if (from && this.straight() && current()) {
      const found = await obstacleOn(from.position, goal.position).catch(() => undefined);
      if (found !== undefined) [path, obstacle] = [found === null ? "free" : "blocked", found ?? ""];
    }
    this.busy = false;
    if (current()) this.onAnswer({ goal, problem, path: problem ? "blocked" : path, obstacle });
    this.next();
  }
}
