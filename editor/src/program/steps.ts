/** The connections of a program as a graph. Part of the shell; conditions and results are in `logic.ts`. */

import type { LogicItem } from "../protocol/types";
import { memoized } from "../store/memo";
import type { OpenDocument } from "../store/state";

export const START = "START";
export const END = "END";

/** Return the key of the view state for the position of a puck; Start and End of each function have their own. */
export const placeKey = (doc: Pick<OpenDocument, "path"> | null, id: string): string =>
  doc?.path.length && (id === START || id === END) ? `place/${doc.path.at(-1)}/${id}` : `place/${id}`;

/** Return the action, START or END at one end of a connection, without the name of the flow. */
export const placeOf = (end: string): string => end.split("/")[0] ?? end;

/** Connections by their start and by their end. */
const indexed = memoized((logic: OpenDocument["logic"]) => {
  const from = new Map<string, LogicItem[]>();
  const to = new Map<string, LogicItem[]>();
  const add = (index: typeof from, id: string, item: LogicItem) => {
    const known = index.get(id);
    if (known) known.push(item);
    else index.set(id, [item]);
  };
  for (const item of Object.values(logic)) {
    add(from, placeOf(item.start), item);
    add(to, placeOf(item.end), item);
  }
  return { from, to };
});

/** Return all connections from an item, error exits included. */
export const outgoing = (doc: OpenDocument, id: string): readonly LogicItem[] => indexed(doc.logic).from.get(id) ?? [];
export const incoming = (doc: OpenDocument, id: string): readonly LogicItem[] => indexed(doc.logic).to.get(id) ?? [];

/** A connection that is followed when its action fails. */
export type ErrorExit = LogicItem & { error_kinds: string[] };

export const isErrorExit = (item: Pick<LogicItem, "error_kinds"> | undefined): item is ErrorExit =>
  (item?.error_kinds?.length ?? 0) > 0;

/** Return the connections that are followed when an action succeeds. */
export const nextSteps = (doc: OpenDocument, id: string): LogicItem[] =>
  outgoing(doc, id).filter((item) => !isErrorExit(item));

/** Return the connections that are followed when an action fails. */
export const errorExits = (doc: OpenDocument, id: string): ErrorExit[] => outgoing(doc, id).filter(isErrorExit);

/** Return whether a connection has a condition that is more than one result being equal to a value. */
export const hasComparisons = ({ when }: Pick<LogicItem, "when">): boolean => (when?.comparisons.length ?? 0) > 0;

/** Return whether a connection has a condition. */
export const isConditional = (item: Pick<LogicItem, "condition" | "when">): boolean =>
  item.condition !== undefined || hasComparisons(item);

/** How a connection is drawn. */
export type BranchKind = "always" | "true" | "false" | "value" | "error";

export function branchKind(item: Pick<LogicItem, "condition" | "error_kinds" | "when">): BranchKind {
  if (isErrorExit(item)) return "error";
  if (hasComparisons(item)) return "value";
  const { value } = item.condition ?? {};
  return value === undefined ? "always" : value === "true" || value === "false" ? value : "value";
}
