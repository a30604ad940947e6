/** From the state to the items of the 3D view. Pure functions that return the same item while nothing changed. */

import { t } from "@lingui/core/macro";
import type { Item, LinkItem, RobotItem } from "../engine/items";
import { decimal } from "../formats";
import { errorWords } from "../program/errorKinds";
import { calledBy, whenOf, whenWords } from "../program/operands";
import { parallelOf } from "../program/parallel";
import { reachOfAction, worse } from "../program/reach";
import { type BranchKind, branchKind, hasComparisons, placeKey } from "../program/steps";
import { takenExit } from "../program/takenExit";
import type { LogicItem, Pose, Position, Reach } from "../protocol/types";
import { isRunning } from "../store/selectors";
import type { OpenDocument, State } from "../store/state";
import type { Draft, Ghost } from "../store/ui";
import { gripperOf, partsOn, placeOf, toolOf } from "./devices";
import { isDim, isOpen, terminalPlaces } from "./program";
import { shapeOf } from "./shapes";
import { faintness } from "./visibility";

export const START = "START";
export const END = "END";

const NO_PLACE = { x: 0, y: 0, z: 0 };
const UPRIGHT = { position: NO_PLACE, orientation: { x: 0, y: 0, z: 0, w: 1 } };

/** Create the items of successive states. */
export class ItemMaker {
  private known = new Map<string, { inputs: unknown[]; item: Item }>();
  private terminalsOf: { inputs: unknown[]; places: ReturnType<typeof terminalPlaces> } | null = null;

  items(state: State): Item[] {
    const { doc } = state;
    if (!doc) {
      this.known.clear();
      return [];
    }
    const before = this.known;
    this.known = new Map();
    const found: Item[] = [];
    const add = (id: string, inputs: unknown[], make: () => Item) => {
      const known = before.get(id);
      const same =
        known && known.inputs.length === inputs.length && known.inputs.every((each, n) => each === inputs[n]);
      const stored = same ? known : { inputs, item: make() };
      this.known.set(id, stored);
      found.push(stored.item);
    };
    const { selection, draft, picked } = state.ui;
    const isSelected = (id: string) => selection?.id === id || (picked?.includes(id) ?? false);
    const me = state.connection.user;
    const faint = faintness(state);
    const common = (id: string, name: string) => ({
      id,
      name,
      selected: isSelected(id),
      lockedBy: lockedBy(state, id, me),
      faint: faint(id),
    });
    const commonInputs = (id: string) => [isSelected(id), lockedBy(state, id, me), faint(id)];

    const axes = state.view.user.hide_axes !== true;
    for (const object of Object.values(doc.objects)) {
      const type = state.types.byName[object.type];
      const robot = state.types.robots[object.type];
      const place = placeOf(state, object);
      if (!place && !robot) continue; // shown in lists only
      const fault = hasFault(state, object.id);
      const online = state.live.state === "started" || isRunning(state);
      const preview = drafted(draft, object) ?? state.previews[object.id];
      const model = type && draft?.type === type ? draft.model : undefined;
      const ghost = state.ui.ghost?.robotId === object.id ? state.ui.ghost : null;
      const { values } = state.live.values[object.id] ?? {};
      const gripper = robot && gripperOf(state, object);
      const live = [robot ? state.live.values[object.id] : values, gripper, gripper && state.live.values[gripper.id]];
      const parts = partsOn(state, object.id);
      const detected = parts?.map(({ sensor, seen }) => sensor + seen).join();
      const looks = [type, robot, fault, robot && online, model, ghost, robot && axes, detected, ...live];
      add(object.id, [object, place, preview, ...looks, ...commonInputs(object.id)], () => {
        const pose = {
          position: preview?.position ?? place?.position ?? NO_PLACE,
          orientation: preview?.orientation ?? place?.orientation ?? UPRIGHT.orientation,
        };
        const base = { ...common(object.id, object.name), pose, fault };
        if (robot)
          return {
            ...base,
            kind: "robot",
            urdf: robot.urdf_package_filename ?? "",
            online,
            axes,
            ghost: ghost ? ghostOf(ghost) : undefined,
            ...toolOf(state, object),
          };
        const shape = shapeOf(type && model ? { ...type, object_model: model } : type);
        return { ...base, kind: "object", shape, values, parts };
      });
    }
    const size = pointSize(state);
    const lines = parentLines(state);
    for (const point of Object.values(doc.points)) {
      const preview = (drafted(draft, point) ?? state.previews[point.id])?.position;
      const breakpoint = point.id in state.breakpoints;
      const tied = point.parent !== undefined && (lines || selection?.id === point.id);
      add(point.id, [point, size, preview, breakpoint, tied, ...commonInputs(point.id)], () => ({
        ...common(point.id, point.name),
        kind: "point",
        size,
        parent: point.parent,
        position: preview ?? point.position,
        breakpoint,
        tied,
      }));
    }
    const reach = bestReach(state);
    for (const one of Object.values(doc.orientations)) {
      const preview = (drafted(draft, one) ?? state.previews[one.id])?.orientation;
      add(one.id, [one, preview, reach[one.id], ...commonInputs(one.id)], () => ({
        ...common(one.id, one.name),
        kind: "orientation",
        parent: one.pointId,
        orientation: preview ?? one.orientation,
        reach: reach[one.id] ?? "",
      }));
    }
    this.pucks(state, doc, add, common, commonInputs);
    if (state.view.user.hide_steps === true && state.ui.connecting === null) return found;
    const open = isOpen(state);
    const dim = isDim(state);
    const exit = takenExit(state)?.id;
    for (const item of Object.values(doc.logic)) {
      const [from, to] = [item.start, item.end].map((id) => doc.actions[id]?.pointId);
      const moved = [item.start, item.end].some((id) => isPosition(state.view.shared[placeKey(doc, id)]));
      const inside = from !== undefined && from === to && !moved && !open(from);
      const pale = dim(item.id);
      const taken = item.id === exit;
      const compared = hasComparisons(item) ? whenWords(doc, state.types, whenOf(item)) : "";
      add(item.id, [item, inside, pale, taken, compared, ...commonInputs(item.id)], () => ({
        ...link(item, compared, common(item.id, "")),
        inside,
        dim: pale && !taken,
        taken,
      }));
    }
    return found;
  }

  private pucks(
    state: State,
    doc: OpenDocument,
    add: (id: string, inputs: unknown[], make: () => Item) => void,
    common: (
      id: string,
      name: string,
    ) => Omit<Item, "kind"> & { id: string; name: string; selected: boolean; lockedBy: string; faint: number },
    commonInputs: (id: string) => unknown[],
  ): void {
    const opened = isOpen(state);
    const dim = isDim(state);
    const levels = new Map<string, number>();
    const counts = new Map<string, number>();
    const lanes = parallelOf(doc);
    const shown = Object.values(doc.actions).filter(({ id }) => !lanes.has(id)); // the puck of parallel work shows them
    for (const { pointId } of shown) counts.set(pointId, (counts.get(pointId) ?? 0) + 1);
    const colours = [...Object.keys(doc.objects), ...Object.keys(doc.functions)];
    for (const action of shown) {
      const level = levels.get(action.pointId) ?? 0;
      levels.set(action.pointId, level + 1);
      const count = counts.get(action.pointId) ?? 1;
      const running = state.program.running.includes(action.id) || state.live.executing === action.id;
      const breakpoint = action.id in state.breakpoints;
      const colour = Math.max(0, colours.indexOf(action.type.split("/")[0] ?? ""));
      const place = state.view.shared[placeKey(doc, action.id)];
      const open = opened(action.pointId);
      const pale = dim(action.id);
      const reach = reachOfAction(action, state.reach)?.reach ?? "";
      const called = calledBy(doc, action);
      add(
        action.id,
        [
          action,
          called,
          level,
          count,
          open,
          pale,
          running,
          breakpoint,
          colour,
          place,
          reach,
          ...commonInputs(action.id),
        ],
        () => ({
          ...common(action.id, action.name),
          kind: "action",
          ...(isPosition(place) ? { position: place } : { parent: action.pointId }),
          level,
          count,
          open,
          dim: pale,
          role: called || action.branches ? "call" : "action",
          running,
          breakpoint,
          colour,
          reach,
        }),
      );
    }
    if (!doc.project?.has_logic) return;
    const places = this.terminals(state, doc);
    for (const [id, role] of [
      [START, "start"],
      [END, "end"],
    ] as const) {
      const place = state.view.shared[placeKey(doc, id)];
      const pale = dim(id);
      add(id, [place, places, pale, ...commonInputs(id)], () => ({
        ...common(id, role === "start" ? t`Start` : t`End`),
        kind: "action",
        position: isPosition(place) ? place : places[id],
        level: 0,
        count: 1,
        open: true,
        dim: pale,
        role,
        running: false,
        breakpoint: false,
        colour: 0,
        reach: "",
      }));
    }
  }

  private terminals({ types }: State, doc: OpenDocument): ReturnType<typeof terminalPlaces> {
    const inputs = [doc.objects, doc.points, doc.actions, doc.logic, types];
    if (!this.terminalsOf || this.terminalsOf.inputs.some((each, n) => each !== inputs[n]))
      this.terminalsOf = { inputs, places: terminalPlaces(doc, types) };
    return this.terminalsOf.places;
  }
}

/** Return the size of points, relative: a setting of the user. */
export function pointSize(state: State): number {
  const stored = state.view.general.point_size;
  return typeof stored === "number" ? Math.min(4, Math.max(0.5, stored)) : 1;
}

/** Return whether lines connect all points to their parents, not only the selected one. */
export const parentLines = (state: State): boolean => state.view.general.parent_lines === true;

function ghostOf({ joints, problem, at }: Ghost): RobotItem["ghost"] {
  return { joints: Object.fromEntries(joints.map((each) => [each.name, each.value])), possible: problem === "", at };
}

/** Return the pose of an item during a change by this user. */
function drafted(draft: Draft | undefined, thing: { id: string }): Pose | undefined {
  return draft?.of === thing ? draft.pose : undefined;
}

function isPosition(value: unknown): value is Position {
  const { x, y, z } = (value ?? {}) as Record<string, unknown>;
  return [x, y, z].every((each) => typeof each === "number" && Number.isFinite(each));
}

function lockedBy(state: State, id: string, me: string): string {
  const owner = state.locks[id];
  return owner && owner !== me ? owner : "";
}

function hasFault(state: State, id: string): boolean {
  const connection = state.live.objects[id]?.state;
  const health = state.live.health[id]?.health;
  return connection === "lost" || connection === "failed" || health === "failure";
}

/** Return the reachability of each orientation by the best robot. */
function bestReach(state: State): Record<string, Reach> {
  const best: Record<string, Reach> = {};
  for (const robot of Object.values(state.reach)) {
    for (const { id, reach } of robot.items) {
      const known = best[id];
      if (!known || worse(known, reach)) best[id] = reach;
    }
  }
  return best;
}

type Own = "kind" | "from" | "to" | "inside" | "condition" | "branch" | "taken";

function link(item: LogicItem, compared: string, base: Omit<LinkItem, Own>): Omit<LinkItem, "inside"> {
  const branch = branchKind(item);
  return { ...base, kind: "logic", from: item.start, to: item.end, condition: wordsOf(item, compared, branch), branch };
}

function wordsOf({ condition, error_kinds = [] }: LogicItem, compared: string, branch: BranchKind): string {
  if (branch === "error") return errorWords(error_kinds);
  return branch === "true" ? t`yes` : branch === "false" ? t`no` : condition ? plain(condition.value) : compared;
}

/** Return a value as text: JSON strings have quotes. */
export function plain(json: string): string {
  try {
    const value: unknown = JSON.parse(json);
    return typeof value === "string" ? value : typeof value === "number" ? decimal(value) : JSON.stringify(value);
  } catch {
    return json;
  }
}
