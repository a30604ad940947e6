/**
 * The objects of the open scene: add, rename, copy, remove; settings and shapes. Functions return why they were
 * refused.
 */

import { t } from "@lingui/core/macro";
import { freeName } from "../program/naming";
import type {
  CheckConnectionData,
  FoundDevice,
  ObjectModel,
  ObjectTypeMeta,
  Parameter,
  Pose,
  Requests,
  SceneObject,
} from "../protocol/types";
import { uploadAsset } from "../session/assets";
import { call } from "../session/connection";
import { whyUnavailable } from "../store/permissions";
import { isClosed } from "../store/selectors";
import type { State } from "../store/state";
import { getState, notify, select, setUi } from "../store/store";
import { lifted } from "../transform/sizes";
import { ORIGIN, plus, rotated } from "../viewmodel/frames";
import { aimedPlace } from "./crosshair";
import { awaited } from "./ownEvents";
import { ask, refusal, sentence, withLock } from "./requests";

/** Requests that are also possible while the scene is online. */
const ONLINE: ReadonlySet<keyof Requests> = new Set<keyof Requests>(["AddSceneObject"]);
/** Requests that are refused while a project is open, since other projects may use the object. */
const SCENE_ALONE: ReadonlySet<keyof Requests> = new Set<keyof Requests>(["RemoveFromScene", "RenameObject"]);

/** Return why objects cannot be added, removed or configured now; an empty string if they can. */
export function notBuildable(state: State, request: keyof Requests): string {
  if (!state.doc) return t`No scene or project is open.`;
  if (state.doc.project && SCENE_ALONE.has(request))
    return t`Other projects may use this object. Close the project and open the scene.`;
  if (isClosed(state)) return t`Stop the program first.`;
  if (state.live.state === "starting" || state.live.state === "stopping")
    return t`Wait until the devices are online or offline.`;
  if (state.live.state !== "stopped" && !ONLINE.has(request))
    return t`Go offline first. Devices can only be changed offline.`;
  return whyUnavailable(state, request);
}

/** Return a name that no other object and no type has. */
export function freeObjectName(base: string): string {
  const { doc, types } = getState();
  const clean = base.replace(/\W/g, "_").replace(/^(\d)/, "_$1") || "object";
  return freeName(clean, [...Object.values(doc?.objects ?? {}).map((each) => each.name), ...Object.keys(types.byName)]);
}

/** Return the pose of a new object: on the surface in the middle of the view, upright; the first one at the origin. */
function newPlace(model?: ObjectModel): Pose {
  const aimed = aimedPlace();
  if (!aimed || !Object.values(getState().doc?.objects ?? {}).some((each) => each.pose)) return ORIGIN;
  const into = rotated({ x: 0, y: 0, z: 1 }, aimed.orientation);
  const out = { x: -into.x, y: -into.y, z: -into.z };
  const fine = (value: number) => Math.round(value * 1e4) / 1e4;
  const { x, y, z } = lifted(aimed.position, out, { pose: ORIGIN, model });
  return { ...ORIGIN, position: { x: fine(x), y: fine(y), z: fine(z) } };
}

/** Wait for the new object and select it. */
async function selectNewObject(name: string): Promise<void> {
  const added = await awaited((state) => Object.values(state.doc?.objects ?? {}).find((each) => each.name === name));
  select({ kind: "object", id: added.id });
  setUi({ tool: "" });
}

export function addObject(type: ObjectTypeMeta, name: string, parameters: Parameter[], node = ""): Promise<string> {
  const pose = type.has_pose ? { pose: newPlace(type.object_model) } : {};
  return refusal(async () => {
    await call("AddSceneObject", { name, type: type.type, parameters, ...pose, ...(node ? { node } : {}) });
    await selectNewObject(name);
  });
}

/** Time limit of a connection check, s; the server has a shorter one. */
const CHECK_TIMEOUT = 45;

/** Connect a device without adding it, and return its report, or the reason why it cannot be connected. */
export async function checkConnection(
  type: string,
  parameters: Parameter[],
  id = "",
  node = "",
): Promise<{ found: CheckConnectionData } | { refused: string }> {
  try {
    const args = { type, parameters, id, ...(node ? { node } : {}) };
    return { found: await call("CheckConnection", args, { deadline: CHECK_TIMEOUT }) };
  } catch (error) {
    return { refused: sentence(error) };
  }
}

/** Time limit of a search, s; the server has a shorter one. */
const SEARCH_TIMEOUT = 30;

/** Search for values of a setting of a device, or return why it failed. */
export async function findDevices(
  type: string,
  setting: string,
  parameters: Parameter[],
  addresses = "",
): Promise<{ found: FoundDevice[] } | { refused: string }> {
  try {
    return { found: await call("FindDevices", { type, setting, parameters, addresses }, { deadline: SEARCH_TIMEOUT }) };
  } catch (error) {
    return { refused: sentence(error) };
  }
}

export type ShapeKind = "table" | "box" | "cylinder" | "sphere";

/** A shape of 10 cm, or a table top of 1.2 m by 0.8 m; `id` becomes the name of its type. */
function shapeModel(kind: ShapeKind, id: string): ObjectModel {
  const size = 0.1;
  if (kind === "table") return { type: "Box", box: { id, size_x: 1.2, size_y: 0.8, size_z: 0.04 } };
  if (kind === "box") return { type: "Box", box: { id, size_x: size, size_y: size, size_z: size } };
  if (kind === "cylinder") return { type: "Cylinder", cylinder: { id, radius: size / 2, height: size } };
  return { type: "Sphere", sphere: { id, radius: size / 2 } };
}

/** Add a shape with a generated name at once. Its properties can be changed later. */
export async function addShape(kind: ShapeKind): Promise<void> {
  const name = freeObjectName(kind);
  const model = shapeModel(kind, name);
  const pose = newPlace(model);
  // The top of a table is the floor of the workplace, on which robots and devices stand.
  const at = kind === "table" ? { ...pose, position: { ...pose.position, z: -0.02 } } : pose;
  const why = await addModel(name, model, at);
  if (why) notify("error", why);
}

function addModel(name: string, model: ObjectModel, pose = newPlace(model)): Promise<string> {
  return refusal(async () => {
    await call("AddSceneShape", { name, pose, model });
    await selectNewObject(name);
  });
}

/** Upload a mesh and add an object with it. */
export function addMesh(name: string, file: File): Promise<string> {
  return refusal(async () => {
    const asset = await uploadAsset(file);
    const why = await addModel(name, { type: "Mesh", mesh: { id: name, asset_id: asset } });
    if (why) throw new Error(why);
  });
}

export const renameObject = (id: string, new_name: string): Promise<string> =>
  refusal(() => withLock(id, () => call("RenameObject", { id, new_name })));

/** Add a copy next to the object; the copy of a shape has its own type. */
export async function duplicateObject({ name, type, pose, parameters, node }: SceneObject): Promise<void> {
  const { types } = getState();
  const meta = types.byName[type];
  const copy = freeObjectName(name.replace(/_\d+$/, ""));
  const nextTo = pose && { ...pose, position: plus(pose.position, { x: 0.1, y: 0.1, z: 0 }) };
  const own = meta?.base === "VirtualCollisionObject" && meta.object_model && nextTo;
  const done = own
    ? await ask("AddSceneShape", {
        name: copy,
        pose: nextTo,
        model: named(meta.object_model as ObjectModel, copy),
      })
    : await ask("AddSceneObject", {
        name: copy,
        type,
        parameters,
        ...(nextTo ? { pose: nextTo } : {}),
        ...(node ? { node } : {}),
      });
  if (done) await selectNewObject(copy).catch(() => {}); // another user has removed it
}

/** Return the same model with another type name. */
export function named(model: ObjectModel, id: string): ObjectModel {
  const { type, box, cylinder, sphere, mesh } = model;
  if (box) return { type, box: { ...box, id } };
  if (cylinder) return { type, cylinder: { ...cylinder, id } };
  if (sphere) return { type, sphere: { ...sphere, id } };
  return { type, ...(mesh ? { mesh: { ...mesh, id } } : {}) };
}

/** Return the names of the projects that use an object. */
export async function projectsUsing(id: string): Promise<string[]> {
  const ids = await call("SceneObjectUsage", { id });
  return ids.map((each) => getState().lists.projects?.find((one) => one.id === each)?.name ?? each);
}

export const removeObject = (id: string, force = false) => ask("RemoveFromScene", { id, force });

export const setParameters = (id: string, parameters: Parameter[]): Promise<string> =>
  refusal(() => withLock(id, () => call("UpdateSceneObjectSettings", { id, parameters })));

/** Return the names of the scenes that use a type. */
export async function scenesUsing(type: string): Promise<string[]> {
  const ids = await call("ObjectTypeUsage", { id: type });
  return ids.map((each) => getState().lists.scenes?.find((one) => one.id === each)?.name ?? each);
}

export const deleteType = (type: string): Promise<string> => refusal(() => call("DeleteObjectTypes", [type]));
