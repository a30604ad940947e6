/** The fixed lower part of the robot panel: the buttons that move the robot, below a message area of fixed height. */

import { msg, t } from "@lingui/core/macro";
import { createContext, type ReactNode, useContext } from "react";
import { createPortal } from "react-dom";
import type { RobotSelection } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";

/** Hint that is shown before a hold-to-run button is pressed. */
export const HOLD_HINT = msg`Motion stops as soon as you release the button.`;

/** The element of the panel in which the pad is shown. */
export const PadPlace = createContext<HTMLElement | null>(null);

interface PadDockProps {
  chosen: RobotSelection;
  /** The reason why the last request was refused; empty if it was accepted. */
  refused: string;
  /** Shown while there is nothing to report. */
  hint: string;
  children: ReactNode;
}

/** Show the pad in its place. Messages and other content of the panel do not change its position. */
export function PadDock({ chosen, refused, hint, children }: PadDockProps) {
  const place = useContext(PadPlace);
  if (!place) return null;
  return createPortal(
    <>
      <MotionNote chosen={chosen} refused={refused} hint={hint} />
      {children}
    </>,
    place,
  );
}

/** Return the progress or the result of a motion in words. */
function phaseWords(phase: "start" | "end" | "failed", goal: string): string {
  switch (phase) {
    case "start":
      return goal ? t`Moving to ${goal}…` : t`Moving…`;
    case "end":
      return goal ? t`Reached ${goal}.` : t`Reached.`;
    case "failed":
      return goal ? t`Not reached: ${goal}.` : t`Not reached.`;
  }
}

/** Show the reason of a refusal, the user who moves the robot, or the result of its last motion. */
function MotionNote({ chosen: { robotId }, refused, hint }: Omit<PadDockProps, "children">) {
  const motion = useEditor((state) => state.live.motions[robotId]);
  const goal = useEditor((state) => (motion?.goal ? nameOf(state, motion.goal) : ""));
  const hold = useEditor((state) => state.live.holds[robotId]);
  const moved = motion && `${phaseWords(motion.phase, goal)} ${motion.message}`;
  const held = hold && (hold.kind === "jog" ? t`${hold.user} is jogging.` : t`${hold.user} is hand-teaching.`);
  const tone = refused ? "error" : held ? "warn" : motion ? motion.phase : "quiet";
  const words = refused || held || moved || hint;
  return (
    <p
      className={`pad-note small ${tone}`}
      role={refused ? "alert" : "status"}
      tabIndex={refused ? 0 : undefined}
      title={words}
    >
      {words}
    </p>
  );
}
