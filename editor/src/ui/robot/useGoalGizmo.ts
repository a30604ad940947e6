/** Put the gizmo at the target; dragging it moves the target. */

import { useEffect, useRef } from "react";
import type { Engine } from "../../engine/engine";
import type { Drag } from "../../engine/gizmo/gizmo";
import type { Pose } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { store } from "../../store/store";
import { plusOf, turnedAbout } from "../../transform/placing";
import { ORIGIN } from "../../viewmodel/frames";

/** Return a target that was dragged from `start`. */
export function dragged(
  start: Pose,
  { handle, translation, axis, angle }: Pick<Drag, "handle" | "translation" | "axis" | "angle">,
): Pose {
  if (handle.kind === "ring") return turnedAbout(start, axis, angle);
  return { ...start, position: plusOf(start.position, translation, 1) };
}

/** `axes`: of the target, or of the world. Hidden without a target. */
export function useGoalGizmo(
  goal: Pose | null,
  mode: "move" | "turn",
  axes: "goal" | "world",
  onDrag: (goal: Pose) => void,
): void {
  const latest = useRef({ goal, mode, axes, onDrag });
  latest.current = { goal, mode, axes, onDrag };
  const shown = goal !== null;
  useEffect(() => {
    if (!shown) return;
    let bound: Engine | null = null;
    let start: Pose | null = null;
    const drag = (one: Drag) => {
      const { current } = latest;
      if (one.phase === "start") start = current.goal;
      else if (start && current.goal) {
        // At the end the gizmo moves to the new target.
        current.onDrag(
          one.phase === "move" ? dragged(start, one) : { ...(one.phase === "cancel" ? start : current.goal) },
        );
      }
    };
    // The view may be recreated with another quality in the meantime.
    const bind = () => {
      const engine = theEngine();
      if (engine === bound) return;
      bound = engine;
      if (engine) engine.gizmo.onDrag = drag;
      show(latest.current);
    };
    bind();
    const stop = store.subscribe(bind);
    return () => {
      stop();
      if (!bound) return;
      bound.gizmo.hide();
      bound.gizmo.onDrag = () => {};
    };
  }, [shown]);
  useEffect(() => show({ goal, mode, axes }), [goal, mode, axes]);
}

function show({ goal, mode, axes }: { goal: Pose | null; mode: "move" | "turn"; axes: "goal" | "world" }): void {
  const engine = theEngine();
  if (!goal || !engine || engine.gizmo.isDragging) return;
  engine.gizmo.show({ mode, at: goal.position, axes: axes === "goal" ? goal.orientation : ORIGIN.orientation });
}
