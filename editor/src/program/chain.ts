/** The position of a new action in the program. Pure functions. */

import type { ObjectAction, ProjectLogicIf } from "../protocol/types";
import type { OpenDocument, State } from "../store/state";
import {
  conditionsOf,
  END,
  errorExits,
  hasComparisons,
  isConditional,
  isErrorExit,
  linkTo,
  nextSteps,
  placeOf,
  START,
} from "./logic";

import { parallelOf, runnerOf } from "./parallel";

const IN_SPACE: ReadonlySet<string> = new Set(["pose", "position", "joints", "relative_pose"]);

/** Return whether an action needs a point in space. */
export const needsPlace = ({ parameters }: ObjectAction): boolean => parameters.some((each) => IN_SPACE.has(each.type));

/** A place after a step of the program; with a condition, on that branch; with an error exit, on that exit. */
export interface Slot {
  after: string;
  condition?: ProjectLogicIf;
  /** Id of an existing error exit. */
  exit?: string;
}

/** Text that identifies a slot. */
export const slotKey = ({ after, condition, exit }: Slot): string => JSON.stringify([after, condition, exit]);

/** Return the slots after a step, the usual one first. */
function slotsAfter(doc: OpenDocument, types: State["types"], after: string): Slot[] {
  return [...regular(doc, types, after), ...errorExits(doc, after).map(({ id }) => ({ after, exit: id }))];
}

function regular(doc: OpenDocument, types: State["types"], after: string): Slot[] {
  const steps = nextSteps(doc, after);
  const plain = steps.find((each) => !isConditional(each));
  const taken = steps.flatMap(({ condition }): Slot[] => (condition ? [{ after, condition }] : []));
  const own = conditionsOf(doc, types, after).find((each) => each.action.id === after && each.type === "boolean");
  const free =
    own && !steps.some(hasComparisons)
      ? ["false", "true"]
          .filter((value) => !taken.some((each) => each.condition?.value === value))
          .map((value) => ({ after, condition: { what: linkTo(own), value } }))
      : [];
  if (!plain) return steps.length === 0 || steps.some(hasComparisons) ? [{ after }, ...free] : [...free, ...taken];
  // The present successor becomes the other branch; an action before End is usually continued instead.
  return placeOf(plain.end) === END ? [{ after }, ...free] : [...free, { after }];
}

/** Return all slots of a program. */
export const slotsOf = (doc: OpenDocument, types: State["types"]): Slot[] =>
  [START, ...Object.keys(doc.actions).filter((id) => !parallelOf(doc).has(id))].flatMap((after) =>
    slotsAfter(doc, types, after),
  );

/** Return the position of the next action: after the selected action, otherwise at the end of the program. */
export function slotFor(doc: OpenDocument, types: State["types"], selected: string): Slot {
  const exit = doc.logic[selected];
  if (isErrorExit(exit)) return { after: placeOf(exit.start), exit: exit.id };
  const after = selected in doc.actions || selected === START ? runnerOf(doc, selected) : lastOf(doc);
  return slotsAfter(doc, types, after)[0] ?? { after };
}

/** Return the last action of the chain from START. */
function lastOf(doc: OpenDocument): string {
  const seen = new Set<string>();
  let at = START;
  while (!seen.has(at)) {
    seen.add(at);
    const next = nextSteps(doc, at).map((each) => placeOf(each.end));
    at = next.find((each) => each !== END && !seen.has(each)) ?? at;
  }
  return at;
}

/** The way in which an action is inserted into a slot. */
interface Insertion {
  /** Connection that leads to the new action from now on. */
  redirect?: string;
  /** Connection that becomes the other branch. */
  branch?: { id: string; condition: ProjectLogicIf };
  /** The successor of the new action. */
  to: string;
}

export function insertion(doc: OpenDocument, { after, condition, exit }: Slot): Insertion {
  if (exit !== undefined) return { redirect: exit, to: doc.logic[exit]?.end ?? END };
  const steps = nextSteps(doc, after);
  const same = steps.find(
    (each) =>
      !hasComparisons(each) && each.condition?.what === condition?.what && each.condition?.value === condition?.value,
  );
  if (same) return { redirect: same.id, to: same.end };
  const plain = steps.find((each) => !isConditional(each));
  if (!condition || !plain) return { to: END };
  return {
    branch: { id: plain.id, condition: { what: condition.what, value: condition.value === "true" ? "false" : "true" } },
    to: END,
  };
}

/**
 * Return the point for a new action in space: the selected one. After an action, or without a selection, it is the
 * first taught point without actions; then the point of the action.
 */
export function pointFor(doc: OpenDocument, selected: string): string {
  if (doc.points[selected]) return selected;
  const taught = doc.orientations[selected]?.pointId ?? doc.joints[selected]?.pointId;
  if (taught) return taught;
  const used = new Set(Object.values(doc.actions).map((each) => each.pointId));
  const free = Object.values(doc.joints).find((each) => !used.has(each.pointId))?.pointId;
  return free ?? doc.actions[selected]?.pointId ?? "";
}
