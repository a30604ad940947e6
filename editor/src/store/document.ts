/** Changes that events make to the open document. Pure functions. */

import type { Action, ActionPoint, Project, Scene, ServerEvent } from "../protocol/types";
import { byId, keep, put, without } from "./records";
import { functionOf, inScope } from "./scope";
import type { OpenDocument } from "./state";

/** Return a scene and its project, split into records by id. */
export function documentFrom(scene: Scene, project: Project | null): OpenDocument {
  const { objects, ...bareScene } = scene;
  const doc: OpenDocument = {
    scene: bareScene,
    project: null,
    unsaved: isUnsaved(project ?? scene),
    closed: false,
    objects: byId(objects),
    points: {},
    orientations: {},
    joints: {},
    actions: {},
    logic: {},
    program: { actions: {}, logic: {} },
    functions: {},
    path: [],
    parameters: {},
    overrides: {},
  };
  if (!project) return doc;
  const { action_points, parameters, functions, logic, object_overrides, ...bareProject } = project;
  let full: OpenDocument = { ...doc, project: bareProject, logic: byId(logic), parameters: byId(parameters) };
  for (const point of action_points) full = withPoint(full, point);
  full.overrides = Object.fromEntries(
    object_overrides.map((each) => [each.id, Object.fromEntries(each.parameters.map((one) => [one.name, one]))]),
  );
  full.program = { actions: full.actions, logic: full.logic };
  full.functions = byId(functions.map(functionOf));
  return full;
}

function isUnsaved(of: { modified?: string; int_modified?: string }): boolean {
  if (!of.modified) return true;
  return of.int_modified !== undefined && Date.parse(of.int_modified) > Date.parse(of.modified);
}

/** Replace a point with everything on it. */
function withPoint(doc: OpenDocument, point: ActionPoint): OpenDocument {
  const { orientations, robot_joints, actions, ...bare } = point;
  const of = <T extends { id: string }>(items: T[]) => byId(items.map((item) => ({ ...item, pointId: point.id })));
  const elsewhere = (item: { pointId: string }) => item.pointId !== point.id;
  return {
    ...doc,
    points: put(doc.points, point.id, bare),
    orientations: { ...keep(doc.orientations, elsewhere), ...of(orientations) },
    joints: { ...keep(doc.joints, elsewhere), ...of(robot_joints) },
    actions: { ...keep(doc.actions, elsewhere), ...of(actions) },
  };
}

function withoutPoint(doc: OpenDocument, id: string): OpenDocument {
  const elsewhere = (item: { pointId: string }) => item.pointId !== id;
  return {
    ...doc,
    points: without(doc.points, id),
    orientations: keep(doc.orientations, elsewhere),
    joints: keep(doc.joints, elsewhere),
    actions: keep(doc.actions, elsewhere),
  };
}

/** Add, update or remove an item of a point. */
function onPoint<T extends { id: string }>(
  record: Record<string, T & { pointId: string }>,
  event: { change_type?: string; parent_id?: string },
  item: T,
): Record<string, T & { pointId: string }> {
  if (event.change_type === "remove") return without(record, item.id);
  const pointId = event.parent_id ?? record[item.id]?.pointId;
  if (pointId === undefined) return record;
  return put(record, item.id, { ...record[item.id], ...item, pointId });
}

/** Return an item that can be moved; undefined if it does not exist. */
export function itemOf(doc: OpenDocument | null, id: string): unknown {
  return doc?.objects[id] ?? doc?.points[id] ?? doc?.orientations[id];
}

/** Return the document after an event, with the same function open; the same object if the event does not affect it. */
export function documentAfter(doc: OpenDocument, event: ServerEvent): OpenDocument {
  const program = inScope(doc, []);
  const after = afterEvent(program, event);
  if (after === program) return doc;
  const { actions, logic } = after;
  const same = actions === program.actions && logic === program.logic;
  return inScope(same ? after : { ...after, program: { actions, logic } }, doc.path);
}

/** Return a document whose program is open after an event. */
function afterEvent(doc: OpenDocument, event: ServerEvent): OpenDocument {
  const removed = event.change_type === "remove";
  switch (event.event) {
    case "SceneSaved":
    case "ProjectSaved":
      return { ...doc, unsaved: false };
    case "SceneChanged":
      if (event.data.id !== doc.scene.id || removed) return doc;
      return { ...doc, scene: { ...doc.scene, ...event.data }, unsaved: doc.unsaved || !doc.project };
    case "ProjectChanged":
      if (event.data.id !== doc.project?.id || removed) return doc;
      return { ...doc, project: { ...doc.project, ...event.data }, unsaved: true };
    case "SceneObjectChanged": {
      const objects = removed ? without(doc.objects, event.data.id) : put(doc.objects, event.data.id, event.data);
      return { ...doc, objects, unsaved: true };
    }
    case "ActionPointChanged": {
      const point = event.data;
      if (removed) return { ...withoutPoint(doc, point.id), unsaved: true };
      if (event.change_type === "update" && "actions" in point) {
        return { ...withPoint(doc, point as ActionPoint), unsaved: true };
      }
      const { id, name, position, parent, display_name, description } = point;
      const bare = { id, name, position, parent, display_name, description };
      return { ...doc, points: put(doc.points, id, bare), unsaved: true };
    }
    case "OrientationChanged":
      return { ...doc, orientations: onPoint(doc.orientations, event, event.data), unsaved: true };
    case "JointsChanged":
      return { ...doc, joints: onPoint(doc.joints, event, event.data), unsaved: true };
    case "ActionChanged":
      return { ...doc, actions: onPoint(doc.actions, event, event.data as Action), unsaved: true };
    case "LogicItemChanged": {
      const logic = removed ? without(doc.logic, event.data.id) : put(doc.logic, event.data.id, event.data);
      return { ...doc, logic, unsaved: true };
    }
    case "FunctionChanged": {
      const { id } = event.data;
      const functions = removed ? without(doc.functions, id) : put(doc.functions, id, functionOf(event.data));
      return { ...doc, functions, unsaved: true };
    }
    case "ProjectParameterChanged": {
      const { id } = event.data;
      const parameters = removed ? without(doc.parameters, id) : put(doc.parameters, id, event.data);
      return { ...doc, parameters, unsaved: true };
    }
    case "OverrideUpdated": {
      const id = event.parent_id ?? "";
      const mine = doc.overrides[id] ?? {};
      const now = removed ? without(mine, event.data.name) : put(mine, event.data.name, event.data);
      return { ...doc, overrides: put(doc.overrides, id, now), unsaved: true };
    }
    default:
      return doc;
  }
}
