/** Repair scenes that the server refuses to open because of problems. */

import { t } from "@lingui/core/macro";
import { call } from "../session/connection";
import { loadLists } from "../session/lists";
import { rest } from "../session/rest";
import { getState } from "../store/store";
import { refusal } from "./requests";

/** Return the objects that the problems of a scene name: the server starts each problem with the object's name. */
const namedObjects = (problems: readonly string[], names: readonly string[]): string[] =>
  names.filter((name) => problems.some((each) => each.startsWith(`${name}: `)));

interface StoredScene {
  objects: { name: string }[];
}

async function read(id: string): Promise<StoredScene> {
  return (await (await rest(`/scenes/${encodeURIComponent(id)}`)).json()) as StoredScene;
}

/** Return the names of faulty objects of a scene; reject if no object is named. */
export async function faultyObjects(id: string, problems: readonly string[]): Promise<string[]> {
  return namedObjects(
    problems,
    (await read(id)).objects.map((each) => each.name),
  );
}

/** Remove objects from a saved scene, after storing a backup. Return why it failed, or an empty string. */
export function removeObjects(id: string, name: string, objects: readonly string[]): Promise<string> {
  return refusal(async () => {
    const taken = new Set(getState().lists.scenes?.map((each) => each.name));
    let copy = t`${name} backup`;
    for (let number = 2; taken.has(copy); number++) copy = t`${name} backup ${number}`;
    const scene = await read(id);
    await call("CopyScene", { source_id: id, target_name: copy });
    const remaining = { ...scene, objects: scene.objects.filter((each) => !objects.includes(each.name)) };
    await rest("/scenes", { method: "PUT", json: remaining });
    await loadLists(); // no event reports problems
  });
}
