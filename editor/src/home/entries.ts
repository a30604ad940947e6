/** Entries of the home screen. Pure functions. */

import type { MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { byName } from "../formats";
import { type ServerMessage, translate } from "../i18n/serverMessages";
import type { Lists } from "../store/state";

export interface Entry {
  kind: "scene" | "project" | "package";
  id: string;
  name: string;
  description: string;
  /** When it was changed or built, and created; RFC 3339, empty if unknown. */
  time: string;
  created: string;
  /** Problems in English, which name the faulty objects. */
  problems: string[];
  /** The problems in the user's language. */
  explanations: string[];
  /** Scene of a project, project of a package. */
  from?: { id: string; name: string; gone: boolean };
  /** Number of projects of a scene. */
  projects?: number;
  /** When a package was last run; empty if never. */
  executed?: string;
}

export type Sort = "changed" | "recent" | "created" | "name" | "name down" | "oldest";
export const SORTS: readonly (readonly [Sort, MessageDescriptor])[] = [
  ["changed", msg`last changed`],
  ["recent", msg`last opened by you`],
  ["oldest", msg`oldest change`],
  ["created", msg`newest`],
  ["name", msg`name A–Z`],
  ["name down", msg`name Z–A`],
];

export function entriesOf(lists: Lists, kind: Entry["kind"]): Entry[] | null {
  const { scenes, projects, packages } = lists;
  switch (kind) {
    case "scene":
      return (
        scenes?.map((scene) => ({
          kind,
          id: scene.id,
          name: scene.name,
          description: scene.description ?? "",
          time: scene.modified ?? "",
          created: scene.created ?? "",
          ...explained(scene),
          projects: projects?.filter((each) => each.scene_id === scene.id).length ?? 0,
        })) ?? null
      );
    case "project":
      return (
        projects?.map((project) => ({
          kind,
          id: project.id,
          name: project.name,
          description: project.description,
          time: project.modified ?? "",
          created: project.created ?? "",
          ...explained(project),
          from: from(project.scene_id, scenes),
        })) ?? null
      );
    case "package":
      return (
        packages?.map(({ id, package_meta: meta, project_meta: project }) => ({
          kind,
          id,
          name: meta.name,
          description: project?.description ?? "",
          time: meta.built,
          created: meta.built,
          ...explained({}),
          executed: meta.executed ?? "",
          ...(project
            ? { from: { id: project.id, name: project.name, gone: !projects?.some((each) => each.id === project.id) } }
            : {}),
        })) ?? null
      );
  }
}

interface Checked {
  problems?: string[];
  problem_messages?: ServerMessage[];
}

function explained({ problems = [], problem_messages }: Checked): Pick<Entry, "problems" | "explanations"> {
  const messages = problem_messages ?? problems.map((text) => ({ text }));
  return { problems, explanations: messages.map((each) => translate(each)) };
}

function from(id: string, of: { id: string; name: string }[] | null): Entry["from"] {
  const found = of?.find((each) => each.id === id);
  return { id, name: found?.name ?? t`a deleted scene`, gone: found === undefined };
}

/** Return the matching entries, sorted; favorites only if asked for. */
export function chosen(
  entries: Entry[],
  search: string,
  sort: Sort,
  stars: ReadonlySet<string> | null,
  recent: readonly string[] = [],
): Entry[] {
  const wanted = search.trim().toLowerCase();
  const found = entries.filter(
    (each) =>
      (!stars || stars.has(each.id)) &&
      `${each.name} ${each.description} ${each.from?.name ?? ""}`.toLowerCase().includes(wanted),
  );
  const opened = new Map(recent.map((id, n) => [id, n]));
  const last = ({ id }: Entry) => opened.get(id) ?? recent.length;
  const by: Record<Sort, (a: Entry, b: Entry) => number> = {
    changed: (a, b) => b.time.localeCompare(a.time),
    // Documents that were never opened follow, sorted by their change.
    recent: (a, b) => last(a) - last(b) || b.time.localeCompare(a.time),
    oldest: (a, b) => a.time.localeCompare(b.time),
    created: (a, b) => b.created.localeCompare(a.created),
    name: byName,
    "name down": (a, b) => byName(b, a),
  };
  return found.sort(by[sort]);
}
