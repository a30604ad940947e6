/** The items of the workplace for the object list: tree, kinds, search. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { byName } from "../formats";
import type { State } from "../store/state";
import type { Kind } from "../store/ui";
import { GROUPS, type Group } from "./visibility";

export interface Row {
  id: string;
  kind: Kind;
  group: Group;
  name: string;
  /** Its type or kind as text. */
  detail: string;
  below: Row[];
}

interface Things {
  /** Items with a pose, with their children. */
  placed: Row[];
  /** Objects without a pose. */
  unplaced: Row[];
  program: Row[];
}

const WORDS = {
  point: msg`Action point`,
  orientation: msg`Orientation`,
  joints: msg`Joints`,
  action: msg`Action`,
  logic: msg`Step`,
  terminal: msg`Program`,
} as const;

export function thingsOf({ doc, types }: Pick<State, "doc" | "types">): Things {
  if (!doc) return { placed: [], unplaced: [], program: [] };
  const points = Object.values(doc.points);
  const row = (id: string, kind: Exclude<Kind, "object">, group: Group, name: string, below: Row[] = []): Row => ({
    id,
    kind,
    group,
    name,
    detail: i18n._(WORDS[kind]),
    below,
  });
  const on = (parent: string | undefined): Row[] =>
    points
      .filter((each) => each.parent === parent)
      .map(({ id, name }) => {
        const mine = (each: { pointId: string }) => each.pointId === id;
        return row(id, "point", "points", name, [
          ...Object.values(doc.actions)
            .filter(mine)
            .map((each) => row(each.id, "action", "actions", each.name)),
          ...Object.values(doc.orientations)
            .filter(mine)
            .map((each) => row(each.id, "orientation", "others", each.name)),
          ...Object.values(doc.joints)
            .filter(mine)
            .map((each) => row(each.id, "joints", "others", each.name)),
          ...on(id),
        ]);
      });
  const objects = Object.values(doc.objects).sort(byName);
  const object = ({ id, name, type }: (typeof objects)[number]): Row => ({
    id,
    kind: "object",
    group: type in types.robots ? "robots" : "objects",
    name,
    detail: types.byName[type]?.display_name ?? type,
    below: on(id),
  });
  const hasPlace = (each: (typeof objects)[number]) => each.pose !== undefined || each.type in types.robots;
  const called = (id: string) => (id === "START" ? t`Start` : id === "END" ? t`End` : (doc.actions[id]?.name ?? ""));
  return {
    placed: [...objects.filter(hasPlace).map(object), ...on(undefined)],
    unplaced: objects.filter((each) => !hasPlace(each)).map(object),
    program: doc.project?.has_logic
      ? [
          row("START", "terminal", "program", t`Start`),
          row("END", "terminal", "program", t`End`),
          ...Object.values(doc.logic).map((each) =>
            row(each.id, "logic", "program", `${called(each.start)} → ${called(each.end)}`),
          ),
        ]
      : [],
  };
}

/** Return all items in order. */
export function flat(rows: readonly Row[]): Row[] {
  return rows.flatMap((each) => [each, ...flat(each.below)]);
}

export const allOf = (things: Things): Row[] => flat([...things.placed, ...things.unplaced, ...things.program]);

/** Return the matching items with their ancestors. */
export function narrowed(rows: readonly Row[], fits: (row: Row) => boolean): Row[] {
  return rows.flatMap((row) => {
    const below = narrowed(row.below, fits);
    return below.length > 0 || fits(row) ? [{ ...row, below }] : [];
  });
}

/** Return whether an item is of one of the groups and contains every word of the search. */
export function fitting(groups: ReadonlySet<string>, words: string): (row: Row) => boolean {
  const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
  return ({ group, name, detail }) => {
    const text = `${name} ${detail}`.toLowerCase();
    return (groups.size === 0 || groups.has(group)) && wanted.every((each) => text.includes(each));
  };
}

/** Return the number of items in each group. */
export function counts(rows: readonly Row[]): Record<Group, number> {
  const found = Object.fromEntries(GROUPS.map((group) => [group, 0])) as Record<Group, number>;
  for (const row of rows) found[row.group]++;
  return found;
}

/** Return the item `by` places further, cyclically; null if there is no other. */
export function neighbour(rows: readonly Row[], id: string, by: 1 | -1): Row | null {
  const at = rows.findIndex((each) => each.id === id);
  const next = rows[(at < 0 ? (by > 0 ? 0 : rows.length - 1) : at + by + rows.length) % rows.length];
  return next && next.id !== id ? next : null;
}
