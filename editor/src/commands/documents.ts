/** Scenes, projects and packages: open, create, save, close, copy, rename, delete. */

import { call } from "../session/connection";
import { theEngine } from "../session/engine";
import { openId } from "../store/selectors";
import type { State } from "../store/state";
import { getState } from "../store/store";
import { awaited } from "./ownEvents";
import { ask, refusal, withLock } from "./requests";

export const openScene = (id: string) => ask("OpenScene", { id });
export const openProject = (id: string) => ask("OpenProject", { id });
export const newScene = (name: string, description = "") => ask("NewScene", { name, description });
export const newProject = (scene_id: string, name: string, description = "", has_logic = true) =>
  ask("NewProject", { scene_id, name, description, has_logic });

/** Create a scene and a project on it, and open the project. Devices are then added in the project. */
export async function startEmpty(scene: string, project: string): Promise<void> {
  if (!(await newScene(scene))) return;
  const made = await awaited((state) => (state.doc?.scene.name === scene ? state.doc.scene.id : undefined)).catch(
    () => "",
  );
  if (made) await newProject(made, project);
}

/** Create a copy with another name and open it. Return whether it was created. */
export async function fromTemplate(kind: "scene" | "project", source: string, name: string): Promise<boolean> {
  const made = await (kind === "scene" ? duplicateScene(source, name) : duplicateProject(source, name));
  if (!made) return false;
  // The list contains its id.
  const id = await listed(kind, name);
  if (id) await (kind === "scene" ? openScene(id) : openProject(id));
  return true;
}

/** Time within which a list contains a new document, s. */
const LIST_TIMEOUT = 10;

function listed(kind: "scene" | "project", name: string): Promise<string> {
  const find = ({ lists }: State) =>
    (kind === "scene" ? lists.scenes : lists.projects)?.find((each) => each.name === name)?.id;
  return awaited(find, LIST_TIMEOUT).catch(() => "");
}

export async function save() {
  const document = openId(getState());
  // Taken now, since the document may be closed as soon as it is saved. In AR, the view shows the picture of the
  // camera, which stays on this device.
  const picture = getState().ui.ar ? undefined : theEngine()?.picture();
  const saved = await (getState().doc?.project ? ask("SaveProject") : ask("SaveScene"));
  // A missing picture is harmless.
  if (saved && picture)
    void import("./thumbnail").then(({ storeThumbnail }) => storeThumbnail(document, picture)).catch(() => {});
  return saved;
}

/** Close the open document; `force` discards unsaved changes. */
export function close(force: boolean) {
  return getState().doc?.project ? ask("CloseProject", { force }) : ask("CloseScene", { force });
}

export const duplicateScene = (source_id: string, target_name: string) => ask("CopyScene", { source_id, target_name });
export const duplicateProject = (source_id: string, target_name: string) =>
  ask("CopyProject", { source_id, target_name });

/** Change a description. Return why it was refused, for fields that show the reason. */
export const describe = (kind: "scene" | "project", id: string, new_description: string): Promise<string> =>
  refusal(() =>
    kind === "scene"
      ? call("UpdateSceneDescription", { scene_id: id, new_description })
      : call("UpdateProjectDescription", { project_id: id, new_description }),
  );
export const rename = (kind: "scene" | "project" | "package", id: string, new_name: string): Promise<string> =>
  refusal(() =>
    kind === "package"
      ? call("RenamePackage", { package_id: id, new_name })
      : withLock(id, () =>
          kind === "scene"
            ? call("RenameScene", { id, new_name })
            : call("RenameProject", { project_id: id, new_name }),
        ),
  );

export const deleteScene = (id: string) => ask("DeleteScene", { id });
export const deleteProject = (id: string) => ask("DeleteProject", { id });
export const deletePackage = (id: string) => ask("DeletePackage", { id });

/** Return the projects of a scene. */
export async function projectsOf(sceneId: string): Promise<{ id: string; name: string }[]> {
  const ids = await call("ProjectsWithScene", { id: sceneId });
  const projects = getState().lists.projects ?? [];
  return ids.map((id) => ({ id, name: projects.find((each) => each.id === id)?.name ?? id }));
}

export const undo = () => ask("Undo");
export const redo = () => ask("Redo");
