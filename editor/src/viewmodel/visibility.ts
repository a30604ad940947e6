/** Visibility of items for the user: hidden, transparent, faded. */

import type { OpenDocument, State } from "../store/state";

/** Kinds of items that can be filtered; `program`: start, end and connections. */
export const GROUPS = ["robots", "objects", "points", "actions", "program", "others"] as const;
export type Group = (typeof GROUPS)[number];

/** Transparency of faded items. */
const FADED = 0.85;

/** Kinds shown in the object list; empty: all. */
export function groupsOf(state: State): Group[] {
  const stored = state.view.user.filters;
  return Array.isArray(stored) ? GROUPS.filter((each) => stored.includes(each)) : [];
}

/** Whether other kinds fade in the view. */
export const fadesOthers = (state: State): boolean => state.view.user.fade_others === true;

/** Opacity of all objects except robots, from 0 to 1. */
export function opacityOfAll(state: State): number {
  const stored = state.view.user.opacity_all;
  return typeof stored === "number" ? Math.min(1, Math.max(0, stored)) : 1;
}

/** Return the transparency of each item; at 1 it is neither drawn nor picked. */
export function faintness(state: State): (id: string) => number {
  const { doc, ui } = state;
  const { blocklist, opacity } = state.view.user;
  const hidden = new Set<unknown>(Array.isArray(blocklist) ? blocklist : []);
  const own = (opacity ?? {}) as Record<string, unknown>;
  const all = 1 - opacityOfAll(state);
  const groups = new Set<Group>(fadesOthers(state) ? groupsOf(state) : []);
  const arrows = state.view.user.hide_orientations !== true;
  return (id) => {
    if (hidden.has(id) || (!arrows && doc && id in doc.orientations && ui.selection?.id !== id)) return 1;
    const object = doc?.objects[id];
    const robot = object !== undefined && object.type in state.types.robots;
    const given = own[id];
    const faint = Math.max(
      typeof given === "number" ? 1 - Math.min(1, Math.max(0, given)) : 0,
      object && !robot ? all : 0,
    );
    if (
      groups.size === 0 ||
      ui.selection?.id === id ||
      groups.has(object ? (robot ? "robots" : "objects") : groupOf(doc, id))
    )
      return faint;
    return object ? Math.max(faint, FADED) : 1;
  };
}

function groupOf(doc: OpenDocument | null, id: string): Group {
  if (doc && id in doc.points) return "points";
  if (doc && id in doc.actions) return "actions";
  return id === "START" || id === "END" || (doc && id in doc.logic) ? "program" : "others";
}
