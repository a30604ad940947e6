/** Parallel work: an action that runs calls of functions at once. Its calls are shown as part of it. Pure functions. */

import type { Action } from "../protocol/types";
import type { OpenDocument } from "../store/state";

const PARALLEL = "functions/parallel";

export const isParallel = ({ type }: Pick<Action, "type">): boolean => type === PARALLEL;

/** Return the parallel action of each of its calls. */
export const parallelOf = (doc: OpenDocument): Map<string, string> =>
  new Map(
    Object.values(doc.actions).flatMap(({ id, branches = [] }) => branches.map((branch) => [branch, id] as const)),
  );

/** Return the names of the calls that a parallel action runs, as text. */
export const branchNames = (doc: OpenDocument, { branches = [] }: Pick<Action, "branches">): string =>
  branches.map((branch) => doc.actions[branch]?.name ?? "?").join(", ");
