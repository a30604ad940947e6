/** Parallel work: an action that runs calls of functions at once. Its calls are shown as part of it. Pure functions. */

import type { Action } from "../protocol/types";
import { perObject } from "../store/memo";
import type { OnPoint, OpenDocument } from "../store/state";

const PARALLEL = "functions/parallel";

export const isParallel = ({ type }: Pick<Action, "type">): boolean => type === PARALLEL;

/** Return the parallel action of each of its calls. */
export const parallelOf = perObject(
  (doc: OpenDocument): Map<string, string> =>
    new Map(
      Object.values(doc.actions).flatMap(({ id, branches = [] }) => branches.map((branch) => [branch, id] as const)),
    ),
);

/** Return the action in the logic that runs an action: its parallel action, or the action itself. */
export const runnerOf = (doc: OpenDocument, id: string): string => parallelOf(doc).get(id) ?? id;

/** Return the calls that a parallel action runs; none for other actions. */
export const callsIn = (doc: OpenDocument, { branches = [] }: Pick<Action, "branches">): OnPoint<Action>[] =>
  branches.flatMap((id) => doc.actions[id] ?? []);
