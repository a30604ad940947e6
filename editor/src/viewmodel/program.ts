/** The drawing of the program in space: stacks, pale items, positions of Start and End. Pure functions. */

import { END, incoming, outgoing, placeOf, START } from "../program/steps";
import type { Position } from "../protocol/types";
import type { OpenDocument, State } from "../store/state";
import { worldOf } from "./frames";
import { shapeOf } from "./shapes";

/** Distances of Start and End from the action next to them, m, and the number of directions that are searched. */
const DISTANCES = [0.2, 0.3, 0.45, 0.6, 0.9];
const DIRECTIONS = 12;
/** Distances to keep, m: from points with actions, from the middle of robots, and from other bodies. */
const CLEAR = 0.16;
const ROBOT = 0.3;
const BODY = 0.08;
const HEIGHT = 0.02;

/** Return whether the actions of a point are arranged around it: at the selection, and at all while connecting. */
export function isOpen({ ui, doc, program }: State): (pointId: string) => boolean {
  const id = ui.selection?.id ?? "";
  const step = placeOf(doc?.logic[id]?.start ?? id);
  const mine = doc?.actions[step]?.pointId ?? doc?.orientations[id]?.pointId ?? id;
  const runs = new Set(program.running.map((each) => doc?.actions[each]?.pointId));
  return (pointId) => ui.connecting !== null || pointId === mine || runs.has(pointId);
}

/** Return which actions and steps are pale: all but the selected ones and their neighbours. */
export function isDim({ ui, doc }: State): (id: string) => boolean {
  const id = ui.selection?.id ?? "";
  if (!doc || ui.connecting !== null) return () => false;
  const step = doc.logic[id];
  const own = new Set(
    step
      ? [placeOf(step.start), placeOf(step.end)]
      : Object.values(doc.actions)
          .filter((each) => each.id === id || each.pointId === id)
          .map((each) => each.id),
  );
  if (id === START || id === END) own.add(id);
  if (own.size === 0) return () => false;
  const near = new Set<string>([...own, id]);
  for (const one of step ? [] : own)
    for (const item of [...incoming(doc, one), ...outgoing(doc, one)]) {
      near.add(item.id);
      near.add(placeOf(item.start));
      near.add(placeOf(item.end));
    }
  return (each) => !near.has(each);
}

/** A part of the floor that is taken: a rectangle turned about its middle, with rounded corners; m, rad. */
interface Taken {
  x: number;
  y: number;
  width: number;
  depth: number;
  yaw: number;
  radius: number;
}

const circle = (x: number, y: number, radius: number): Taken => ({ x, y, width: 0, depth: 0, yaw: 0, radius });

function covers({ yaw, width, depth, radius, ...middle }: Taken, x: number, y: number): boolean {
  const [dx, dy] = [x - middle.x, y - middle.y];
  const along = Math.abs(dx * Math.cos(yaw) + dy * Math.sin(yaw)) - width / 2;
  const across = Math.abs(dy * Math.cos(yaw) - dx * Math.sin(yaw)) - depth / 2;
  return Math.hypot(Math.max(0, along), Math.max(0, across)) < radius;
}

/**
 * Return places of Start and End in the world: to the left of the first and to the right of the last action, or as
 * near as they are clear of bodies and points.
 */
export function terminalPlaces(doc: OpenDocument, types: State["types"]): Record<"START" | "END", Position> {
  const taken: Taken[] = [];
  for (const object of Object.values(doc.objects)) {
    const shape = shapeOf(types.byName[object.type]);
    const { x, y } = object.pose?.position ?? { x: 0, y: 0 };
    if (object.type in types.robots) taken.push(circle(x, y, ROBOT));
    else if (!object.pose || shape.kind === "mesh") continue;
    else if (shape.kind === "box") {
      const [width, depth, height] = shape.size;
      // Start and End may be on plates.
      if (height < 0.1 * Math.min(width, depth)) continue;
      const { z, w } = object.pose.orientation;
      taken.push({ x, y, width, depth, yaw: 2 * Math.atan2(z, w), radius: BODY });
    } else taken.push(circle(x, y, BODY + (shape.kind === "none" ? 0 : shape.radius)));
  }
  const used = new Set(Object.values(doc.actions).map((each) => each.pointId));
  for (const id of used) {
    const { x, y } = worldOf(doc, id).position;
    taken.push(circle(x, y, CLEAR));
  }
  const place = (item: string | undefined, preferred: number): Position => {
    const near = worldOf(doc, doc.actions[item ?? ""]?.pointId).position;
    for (const distance of DISTANCES)
      for (let n = 0; n < DIRECTIONS; n++) {
        const angle = preferred + ((n % 2 ? 1 : -1) * Math.ceil(n / 2) * 2 * Math.PI) / DIRECTIONS;
        const [x, y] = [near.x + distance * Math.cos(angle), near.y + distance * Math.sin(angle)];
        if (taken.some((each) => covers(each, x, y))) continue;
        taken.push(circle(x, y, CLEAR));
        return { x, y, z: near.z + HEIGHT };
      }
    return { x: near.x + Math.cos(preferred), y: near.y + Math.sin(preferred), z: near.z + HEIGHT };
  };
  const first = outgoing(doc, START)[0];
  const last = incoming(doc, END)[0];
  return {
    START: place(first && placeOf(first.end), (-3 * Math.PI) / 4),
    END: place(last && placeOf(last.start), -Math.PI / 4),
  };
}
