/** What things are called on the screen: by their names, never by ids. */

import type { Kind, Selection, State } from "../store/state";

export const KINDS: Record<Kind, string> = {
  object: "Object",
  point: "Action point",
  orientation: "Orientation",
  joints: "Joints",
  action: "Action",
  logic: "Step",
  terminal: "Program",
};

export function nameOf(state: State, id: string): string {
  const { doc } = state;
  if (id === "START") return "Start";
  if (id === "END") return "End";
  if (!doc) return "";
  const step = doc.logic[id];
  if (step) return `${nameOf(state, step.start)} → ${nameOf(state, step.end)}`;
  const named = doc.objects[id] ?? doc.points[id] ?? doc.orientations[id] ?? doc.joints[id] ?? doc.actions[id];
  return named?.name ?? "";
}

/** A sentence of the server with names in place of ids. */
export function withNames(state: State, text: string): string {
  return text.replace(/\b[a-z]{3}_[0-9a-f]{32}\b/g, (id) => nameOf(state, id) || id);
}

/** What is selected when the thing with this id is tapped. */
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
  return null;
}
