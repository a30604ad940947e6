/** Names of items as shown to users. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { anyAction, pathTo } from "../store/scope";
import type { State } from "../store/state";
import type { Kind, Selection } from "../store/ui";

const KINDS: Record<Kind, MessageDescriptor> = {
  object: msg`Object`,
  point: msg`Action point`,
  orientation: msg`Orientation`,
  joints: msg`Joints`,
  action: msg`Action`,
  logic: msg`Step`,
  terminal: msg`Program`,
};

/** Return the name of a kind as shown to users. */
export const kindName = (kind: Kind): string => i18n._(KINDS[kind]);

export function nameOf(state: State, id: string): string {
  const { doc } = state;
  if (id === "START") return t`Start`;
  if (id === "END") return t`End`;
  if (!doc) return "";
  const step = doc.logic[id];
  if (step) return `${nameOf(state, step.start)} → ${nameOf(state, step.end)}`;
  const named =
    doc.objects[id] ??
    doc.points[id] ??
    doc.orientations[id] ??
    doc.joints[id] ??
    doc.functions[id] ??
    anyAction(doc, id);
  return named?.name ?? "";
}

/** Return a sentence of the server with names instead of ids. */
export function withNames(state: State, text: string): string {
  return text.replace(/\b[a-z]{3}_[0-9a-f]{32}\b/g, (id) => nameOf(state, id) || id);
}

/** Return the selection of a tapped item. */
export function selectionOf(state: State, id: string): Selection | null {
  const { doc } = state;
  if (!doc) return null;
  if (id === "START" || id === "END") return { kind: "terminal", id };
  const kinds = {
    object: doc.objects,
    point: doc.points,
    orientation: doc.orientations,
    joints: doc.joints,
    action: doc.actions,
    logic: doc.logic,
  };
  for (const [kind, record] of Object.entries(kinds)) if (id in record) return { kind: kind as Kind, id };
  // The item is in a program or function that is not open.
  if (pathTo(doc, id)) return { kind: anyAction(doc, id) ? "action" : "logic", id };
  return null;
}
