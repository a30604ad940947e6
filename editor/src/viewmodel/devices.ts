/** The visible state of devices: their place, reported values, grippers and parts at robots. Pure functions. */

import type { CarriedItem, DetectedPart, RobotItem } from "../engine/items";
import type { Pose, Position, SceneObject } from "../protocol/types";
import type { State } from "../store/state";
import { shapeOf } from "./shapes";

/** Widths of a gripper that only reports whether it is closed, m. */
const OPEN = 0.09;
const CLOSED = 0;
const GRIPPERS = ["gripper", "suction"];
/** Icons of types without a pose that the view can draw; the rest are services, and grippers, which are at robots. */
const DRAWN = ["light", "printer", "reader", "io", "scale", "axis", "machine"];

/** Return the pose at which an object is drawn: its own, or one chosen by users; undefined without both. */
export function placeOf({ view }: Pick<State, "view">, object: SceneObject): Pose | undefined {
  if (object.pose) return object.pose;
  const place = view.scene[`place/${object.id}`];
  return isPose(place) ? place : undefined;
}

/** Return whether users can put an object into the view that has no pose. */
export function isPlaceable({ types }: Pick<State, "types">, object: SceneObject): boolean {
  return !object.pose && DRAWN.includes(types.byName[object.type]?.icon ?? "");
}

function isPose(value: unknown): value is Pose {
  const { position, orientation } = (value ?? {}) as Partial<Record<keyof Pose, unknown>>;
  return finite(position, "xyz") && finite(orientation, "xyzw");
}

function finite(value: unknown, names: string): value is Position {
  return [...names].every((name) => Number.isFinite((value as Record<string, unknown> | undefined)?.[name]));
}

/** Return the places at which sensors detect parts on an object; undefined without a sensor. */
export function partsOn({ view, live }: Pick<State, "view" | "live">, id: string): DetectedPart[] | undefined {
  const found: DetectedPart[] = [];
  for (const [key, value] of Object.entries(view.scene)) {
    const [kind, device = "", name = ""] = key.split("/");
    if (kind !== "part") continue;
    const { on, position, size } = (value ?? {}) as Record<string, unknown>;
    const seen = live.values[device]?.values[name] === 1;
    if (on === id && finite(position, "xyz") && finite(size, "xyz")) found.push({ sensor: key, seen, position, size });
  }
  return found.length > 0 ? found : undefined;
}

/** Return the object of a separate gripper that a robot carries; undefined without one. */
export function gripperOf({ doc, types }: Pick<State, "doc" | "types">, robot: SceneObject): SceneObject | undefined {
  const objects = Object.values(doc?.objects ?? {});
  const alone = objects.filter(({ type }) => types.robots[type]).length === 1;
  return objects.find((object) => {
    if (object.pose || !GRIPPERS.includes(types.byName[object.type]?.icon ?? "")) return false;
    const carrier = JSON.parse(object.parameters?.find(({ name }) => name === "robot")?.value ?? '""');
    return carrier === robot.name || carrier === robot.id || (alone && !carrier);
  });
}

/** Return the items at the flange of a robot in the view: its gripper and the carried parts. */
export function toolOf(state: State, robot: SceneObject): Pick<RobotItem, "tool" | "parts"> {
  const own = state.live.values[robot.id];
  const parts = own?.parts.map(({ name, link, pose, model }): CarriedItem => {
    const object = Object.values(state.doc?.objects ?? {}).find((each) => each.name === name);
    const type = model ? { object_model: model } : state.types.byName[object?.type ?? ""];
    return { link, pose, shape: shapeOf(type) };
  });
  const gripper = gripperOf(state, robot);
  const gripped = own?.values.gripped;
  if (gripper) {
    const values = state.live.values[gripper.id]?.values ?? {};
    return { parts, tool: { icon: state.types.byName[gripper.type]?.icon ?? "", values } };
  }
  if (gripped === undefined) return { parts };
  const [box] = parts?.flatMap(({ shape }) => (shape.kind === "box" ? [shape] : [])) ?? [];
  const width = gripped ? Math.min(OPEN, box?.size[1] ?? CLOSED) : OPEN;
  return { parts, tool: { icon: "gripper", values: { width } } };
}
