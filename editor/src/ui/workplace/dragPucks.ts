/** Drag the selected puck on its level; on release it is moved for all users. */

import { notEditable, placePuck, showPuck } from "../../commands/program";
import type { Engine } from "../../engine/engine";
import { placeKey } from "../../program/steps";
import { getState } from "../../store/store";

/** Distance after which a touch is a drag, pixels. */
const BEGINS = 6;

/** Listen on the canvas; return a function that stops listening. */
export function dragPucks(engine: Engine, canvas: HTMLCanvasElement): () => void {
  let held: {
    id: string;
    level: number;
    x: number;
    y: number;
    moved: boolean;
    pointer: number;
    before: unknown;
  } | null = null;
  const place = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top] as const;
  };
  const down = (event: PointerEvent) => {
    const { selection } = getState().ui;
    if (held || !event.isPrimary || event.button !== 0 || !selection || getState().ui.connecting) return;
    if (selection.kind !== "action" && selection.kind !== "terminal") return;
    const [x, y] = place(event);
    if (
      engine.pick(x, y, event.pointerType === "mouse" ? 4 : 14)[0]?.id !== selection.id ||
      notEditable(getState(), "PreviewMove")
    )
      return;
    const level = engine.item(selection.id)?.pose.position.z ?? 0;
    held = {
      id: selection.id,
      level,
      x,
      y,
      moved: false,
      pointer: event.pointerId,
      before: getState().view.shared[placeKey(getState().doc, selection.id)],
    };
    engine.view.enable(false);
    canvas.setPointerCapture(event.pointerId);
  };
  const move = (event: PointerEvent) => {
    if (!held || event.pointerId !== held.pointer) return;
    const [x, y] = place(event);
    held.moved ||= Math.hypot(x - held.x, y - held.y) > BEGINS;
    const at = held.moved && engine.floor(x, y, held.level);
    if (at) showPuck(held.id, { x: at.x, y: at.y, z: held.level });
  };
  const end = (event: PointerEvent) => {
    if (!held || event.pointerId !== held.pointer) return;
    const { id, level, moved, before } = held;
    held = null;
    engine.view.enable(true);
    if (!moved) return;
    const at = event.type === "pointerup" && engine.floor(...place(event), level);
    if (at) void placePuck(id, { x: at.x, y: at.y, z: level });
    else showPuck(id, before);
  };
  canvas.addEventListener("pointerdown", down, true);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  return () => {
    canvas.removeEventListener("pointerdown", down, true);
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", end);
    canvas.removeEventListener("pointercancel", end);
  };
}
