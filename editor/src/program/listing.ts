/** The program as a list in the order of execution, with indented branches. Pure functions. */

import type { LogicItem } from "../protocol/types";
import type { OpenDocument } from "../store/state";
import { callsIn, parallelOf } from "./parallel";
import { END, incoming, isConditional, isErrorExit, nextSteps, outgoing, placeOf, START } from "./steps";

/**
 * A row: an action; a call that the parallel action above runs at the same time as others; the head of a branch; or
 * where a branch continues, if that is not the next row of a lower depth. `unreached` heads the actions that never run.
 */
export type Row =
  | { kind: "action"; id: string; depth: number }
  | { kind: "lane"; id: string; depth: number }
  | { kind: "branch"; item: LogicItem; depth: number }
  | { kind: "goto"; item: LogicItem; depth: number }
  | { kind: "unreached"; depth: 0 };

/** Return the rows of a program. Each action has one row. */
export function listingOf(doc: OpenDocument): Row[] {
  const order = topological(doc);
  const parents = dominators(doc, order);
  const children = new Map<string, string[]>();
  for (const id of order) {
    const parent = parents.get(id);
    if (parent !== undefined) children.set(parent, [...(children.get(parent) ?? []), id]);
  }
  const sizes = new Map<string, number>();
  for (const id of [...order].reverse())
    sizes.set(
      id,
      (children.get(id) ?? []).reduce((sum, each) => sum + (sizes.get(each) ?? 0), 1),
    );

  const rows: Row[] = [];
  const list = (id: string, depth: number) => {
    rows.push({ kind: "action", id, depth });
    for (const call of callsIn(doc, doc.actions[id] ?? {})) rows.push({ kind: "lane", id: call.id, depth: depth + 1 });
  };
  /** Rows and blocks still to be listed, the next one last. `next` of a block: the action after it. */
  const waiting: (Row | { kind: "block"; id: string; depth: number; next: string | null })[] = [];
  const later: typeof waiting = [];
  const block = (id: string, depth: number, next: string | null) => later.push({ kind: "block", id, depth, next });
  /** List the actions after a connection here if they belong to it, otherwise refer to their place in the list. */
  const follow = (item: LogicItem, owner: string, depth: number, next: string | null, head = false) => {
    const target = placeOf(item.end);
    const only = incoming(doc, target).length === 1;
    if (only && parents.get(target) === owner) block(target, depth, next);
    else if (target !== next || head) later.push({ kind: "goto", item, depth });
  };
  const expand = (id: string, depth: number, next: string | null) => {
    const steps = nextSteps(doc, id);
    const exits = outgoing(doc, id).filter(isErrorExit);
    const own = (item: LogicItem) =>
      incoming(doc, placeOf(item.end)).length === 1 && parents.get(placeOf(item.end)) === id;
    const joins = (children.get(id) ?? []).filter((each) => incoming(doc, each).length > 1);
    const first = joins[0] ?? next;
    const only = steps.length === 1 && steps[0] && !isConditional(steps[0]) ? steps[0] : undefined;
    for (const item of exits) {
      later.push({ kind: "branch", item, depth: depth + 1 });
      follow(item, id, depth + 2, only ? placeOf(only.end) : null, true);
    }
    if (only) follow(only, id, depth, first);
    else if (joins.length === 0 && steps.some(own)) {
      // No branch joins another one: the longest one stays at its depth, after the others.
      const size = (item: LogicItem) => (own(item) ? (sizes.get(placeOf(item.end)) ?? 0) : 0);
      const main = steps.reduce((best, each) => (size(each) > size(best) ? each : best));
      for (const item of steps)
        if (item !== main) {
          later.push({ kind: "branch", item, depth: depth + 1 });
          follow(item, id, depth + 2, null, true);
        }
      later.push({ kind: "branch", item: main, depth });
      follow(main, id, depth, next, true);
    } else
      for (const item of steps) {
        later.push({ kind: "branch", item, depth: depth + 1 });
        follow(item, id, depth + 2, first, true);
      }
    joins.forEach((join, n) => {
      block(join, depth, joins[n + 1] ?? next);
    });
  };

  waiting.push({ kind: "block", id: START, depth: 0, next: END });
  for (let one = waiting.pop(); one !== undefined; one = waiting.pop()) {
    if (one.kind !== "block") {
      rows.push(one);
      continue;
    }
    if (one.id !== START) list(one.id, one.depth);
    expand(one.id, one.depth, one.next);
    while (later.length > 0) waiting.push(later.pop() as (typeof later)[number]);
  }
  const known = new Set([...order, ...parallelOf(doc).keys()]);
  const rest = Object.keys(doc.actions).filter((id) => !known.has(id));
  if (rest.length > 0) {
    if (rows.length > 0) rows.push({ kind: "unreached", depth: 0 });
    for (const id of rest) list(id, 0);
  }
  return rows;
}

/** Return the actions in the order of the list. */
export const ordered = (doc: OpenDocument): string[] =>
  listingOf(doc).flatMap((row) => (row.kind === "action" ? [row.id] : []));

/** Return START and the actions reached from it; each after all that lead to it. */
function topological(doc: OpenDocument): string[] {
  const done: string[] = [];
  const seen = new Set<string>([START]);
  const path = [{ id: START, rest: [...outgoing(doc, START)] }];
  for (let top = path.at(-1); top !== undefined; top = path.at(-1)) {
    const item = top.rest.pop();
    const next = item && placeOf(item.end);
    if (next === undefined) {
      done.push(top.id);
      path.pop();
    } else if (next !== END && next in doc.actions && !seen.has(next)) {
      seen.add(next);
      path.push({ id: next, rest: [...outgoing(doc, next)] });
    }
  }
  return done.reverse();
}

/** Return the immediate dominator of each action: the last one that is on all paths to it. */
function dominators(doc: OpenDocument, order: readonly string[]): Map<string, string> {
  const number = new Map(order.map((id, n) => [id, n]));
  const parents: number[] = [0];
  const common = (one: number, other: number) => {
    let [a, b] = [one, other];
    while (a !== b) {
      if (a > b) a = parents[a] as number;
      else b = parents[b] as number;
    }
    return a;
  };
  for (let n = 1; n < order.length; n++) {
    const before = incoming(doc, order[n] as string).flatMap((item) => number.get(placeOf(item.start)) ?? []);
    parents[n] = before.reduce(common);
  }
  return new Map(order.slice(1).map((id, n) => [id, order[parents[n + 1] as number] as string]));
}
