/** Scenes, projects and packages as wholes: open, make, save, close, copy, rename, delete. */

import { call } from "../session/session";
import { now } from "../store/store";
import { ask, holding } from "./asking";

export const openScene = (id: string) => ask("OpenScene", { id });
export const openProject = (id: string) => ask("OpenProject", { id });
export const newScene = (name: string, description = "") => ask("NewScene", { name, description });
export const newProject = (scene_id: string, name: string, description = "", has_logic = true) =>
  ask("NewProject", { scene_id, name, description, has_logic });

export function save() {
  return now().doc?.project ? ask("SaveProject") : ask("SaveScene");
}

/** Close what is open; `force` throws unsaved changes away. */
export function close(force: boolean) {
  return now().doc?.project ? ask("CloseProject", { force }) : ask("CloseScene", { force });
}

export const duplicateScene = (source_id: string, target_name: string) => ask("CopyScene", { source_id, target_name });
export const duplicateProject = (source_id: string, target_name: string) =>
  ask("CopyProject", { source_id, target_name });

export const renameScene = (id: string, new_name: string) => holding(id, () => ask("RenameScene", { id, new_name }));
export const renameProject = (project_id: string, new_name: string) =>
  holding(project_id, () => ask("RenameProject", { project_id, new_name }));
export const renamePackage = (package_id: string, new_name: string) => ask("RenamePackage", { package_id, new_name });

export const deleteScene = (id: string) => ask("DeleteScene", { id });
export const deleteProject = (id: string) => ask("DeleteProject", { id });
export const deletePackage = (id: string) => ask("DeletePackage", { id });

/** Names of the projects that need a scene. */
export async function projectsOf(sceneId: string): Promise<string[]> {
  const ids = await call("ProjectsWithScene", { id: sceneId });
  const projects = now().lists.projects ?? [];
  return ids.map((id) => projects.find((each) => each.id === id)?.name ?? id);
}

export const undo = () => ask("Undo");
export const redo = () => ask("Redo");
