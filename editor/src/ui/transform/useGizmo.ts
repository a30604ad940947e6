/** Put the gizmo at the selected item, and apply its drags. */

import { useEffect } from "react";
import { beginMove, type ItemMove } from "../../commands/move";
import { chosenRobot } from "../../commands/robot";
import type { Engine } from "../../engine/engine";
import type { Drag } from "../../engine/gizmo/gizmo";
import type { GizmoMode } from "../../engine/gizmo/handles";
import { worldPose } from "../../engine/poses";
import type { Pose, Position } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import type { State } from "../../store/state";
import { getState, store } from "../../store/store";
import type { Selection } from "../../store/ui";
import { amountText } from "../../transform/amounts";
import { type Axis, minus, moved, onGrid, plusOf, rounded, turnedAbout } from "../../transform/placing";
import { halfOf, lifted, pulled } from "../../transform/sizes";
import { frameOf, notMovable, notSizable, type Target, targetOf } from "../../transform/target";
import { toolSettings } from "../../transform/tool";
import { ORIGIN } from "../../viewmodel/frames";

/** Distance within which the pointer snaps to another item, px. */
const CATCH = 28;
/** Precision of free drags, m and rad. */
const FINE = 0.0001;
const FINE_TURN = Math.PI / 1800;

export function viewPose(): Pose {
  const camera = theEngine()?.view.camera;
  return camera ? worldPose(camera) : ORIGIN;
}

/** The frame of the axes. */
export function toolFrame(state: State, target: Target): Pose {
  const { frame } = toolSettings(state);
  return frameOf(state, frame, target, chosenRobot(state)?.robotId ?? "", viewPose());
}

export function useGizmo(selection: Selection, mode: GizmoMode): void {
  const { kind, id } = selection;
  useEffect(() => {
    const mine: Selection = { kind, id };
    let bound: Engine | null = null;
    const follow = new Follower(mine);
    const update = () => {
      const engine = theEngine();
      if (engine !== bound) {
        bound = engine;
        if (engine) engine.gizmo.onDrag = (drag) => follow.drag(engine, drag);
      }
      if (!engine || engine.gizmo.isDragging) return;
      const state = getState();
      const target = targetOf(state, mine);
      const possible =
        target &&
        (mode === "size"
          ? target.model && !notSizable(state, target)
          : (mode === "move" ? target.moves : target.turns) && !notMovable(state, target));
      if (!target || !possible) return engine.gizmo.hide();
      const { frame } = toolSettings(state);
      const own = mode === "size" ? target.pose.orientation : toolFrame(state, target).orientation;
      const half = mode === "size" && target.model ? { half: halfOf(target.model) } : {};
      engine.gizmo.show({
        mode,
        at: target.pose.position,
        axes: frame === "view" && mode !== "size" ? "view" : own,
        ...half,
      });
    };
    update();
    const stop = store.subscribe(update);
    return () => {
      stop();
      if (!bound) return;
      bound.gizmo.hide();
      bound.gizmo.onDrag = () => {};
      bound.note("", "");
    };
  }, [kind, id, mode]);
}

/** Apply one drag after the other. */
class Follower {
  private start: Target | null = null;
  private one: ItemMove | null = null;

  constructor(private readonly selection: Selection) {}

  drag(engine: Engine, drag: Drag): void {
    if (drag.phase === "start") {
      this.start = targetOf(getState(), this.selection);
      this.one = this.start && beginMove(this.start);
      return;
    }
    const { start, one } = this;
    if (!start || !one) return;
    if (drag.phase === "move") this.move(engine, drag, start, one);
    else {
      if (drag.phase === "end") one.finish();
      else one.cancel();
      engine.note("", "");
      this.start = this.one = null;
    }
  }

  private move(engine: Engine, drag: Drag, start: Target, one: ItemMove): void {
    if (one.failed) return; // refused: the user has been notified
    const state = getState();
    const { snap, lengthStep, angleStep, length, angle } = toolSettings(state);
    const { handle } = drag;
    const grid = snap === "grid";
    const note = (text: string) => engine.note(start.id, text);
    const frame = toolFrame(state, start);
    switch (handle.kind) {
      case "axis": {
        const by = rounded(drag.length, grid ? lengthStep : FINE);
        one.moveTo({ ...start.pose, position: plusOf(start.pose.position, drag.axis, by) });
        return note(`${handle.axis.toUpperCase()} ${signed(amountText(by, length))} ${length}`);
      }
      case "plane": {
        const free = { ...start.pose, position: plusOf(start.pose.position, drag.translation, 1) };
        const along = (["x", "y", "z"] as Axis[]).filter((each) => each !== handle.axis);
        const position = onGrid(free.position, frame, grid ? lengthStep : FINE, along);
        one.moveTo({ ...free, position });
        return note(translationText(minus(position, start.pose.position), length));
      }
      case "free": {
        const pose = this.freely(engine, drag, start);
        one.moveTo(pose);
        return note(translationText(minus(pose.position, start.pose.position), length));
      }
      case "ring": {
        const by = rounded(drag.angle, grid ? angleStep : FINE_TURN);
        one.moveTo(turnedAbout(start.pose, drag.axis, by));
        return note(`${signed(amountText(by, angle))}${angle === "°" ? "°" : " rad"}`);
      }
      case "face": {
        if (!start.model) return;
        const { model, shift } = pulled(start.model, handle.axis, rounded(drag.length, grid ? lengthStep : FINE));
        one.moveTo(moved(start.pose, start.pose, handle.axis, shift * handle.sign), model);
        const half = halfOf(model);
        return note(`${amountText(half[handle.axis] * 2, length)} ${length}`);
      }
    }
  }

  /** Return the pose of an item that follows the pointer. */
  private freely(engine: Engine, drag: Drag, start: Target): Pose {
    const state = getState();
    const { snap, lengthStep } = toolSettings(state);
    const free = { ...start.pose, position: plusOf(start.pose.position, drag.translation, 1) };
    const doc = state.doc;
    if (snap === "grid") return { ...free, position: onGrid(free.position, toolFrame(state, start), lengthStep) };
    if (snap === "point" && doc) {
      let best: Position | null = null;
      let least = CATCH;
      for (const id of [...Object.keys(doc.points), ...Object.keys(doc.objects)]) {
        const item = id === start.id ? undefined : engine.item(id);
        if (!item?.screen) continue;
        const apart = Math.hypot(item.screen.x - drag.x, item.screen.y - drag.y);
        if (apart < least) [best, least] = [item.pose.position, apart];
      }
      return best ? { ...start.pose, position: best } : free;
    }
    if (snap === "surface" && doc) {
      const hit = engine
        .pick(drag.x, drag.y, 0)
        .find((each) => each.normal && each.id !== start.id && each.id in doc.objects);
      const point = hit?.point ?? engine.floor(drag.x, drag.y);
      if (!point) return free;
      const normal = hit?.normal ?? { x: 0, y: 0, z: 1 };
      return { ...start.pose, position: lifted(point, normal, start) };
    }
    return free;
  }
}

function signed(text: string): string {
  return text.startsWith("-") ? `−${text.slice(1)}` : `+${text}`;
}

function translationText(by: Position, unit: ReturnType<typeof toolSettings>["length"]): string {
  const part = (axis: "x" | "y" | "z") => `${axis.toUpperCase()} ${signed(amountText(rounded(by[axis], FINE), unit))}`;
  return `${part("x")}  ${part("y")}  ${part("z")} ${unit}`;
}
