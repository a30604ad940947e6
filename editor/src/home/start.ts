/** The first proposal of the home screen. Pure functions. */

import type { Lists } from "../store/state";
import type { RecentIds } from "./opened";

/** Continue with a document, start with the newest one of other users, or create the first one. */
type Proposal =
  | { kind: "continue" | "start"; document: "scene" | "project"; id: string; name: string }
  | { kind: "empty" };

/** Return what to propose; null until the lists are loaded. */
export function proposalOf({ scenes, projects }: Lists, opened: RecentIds): Proposal | null {
  if (!scenes || !projects) return null;
  const all = [
    ...projects.map((each) => ({ ...each, document: "project" as const })),
    ...scenes.map((each) => ({ ...each, document: "scene" as const })),
  ].filter((each) => !each.problems?.length);
  const last = opened.map((id) => all.find((each) => each.id === id)).find((each) => each !== undefined);
  if (last) return { kind: "continue", document: last.document, id: last.id, name: last.name };
  const newest = all
    .filter((each) => each.document === "project")
    .sort((a, b) => (b.modified ?? "").localeCompare(a.modified ?? ""))[0];
  if (newest) return { kind: "start", document: "project", id: newest.id, name: newest.name };
  return scenes.length + projects.length === 0 ? { kind: "empty" } : null;
}
