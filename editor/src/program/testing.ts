/** Programs for unit tests. */

import type { LogicItem, ObjectAction, Project, Scene } from "../protocol/types";
import { documentFrom } from "../store/document";
import type { OpenDocument, State } from "../store/state";
import { initialState } from "../store/state";

export const meta = (name: string, returns: string[], parameters: ObjectAction["parameters"] = []): ObjectAction => ({
  name,
  parameters,
  returns,
  disabled: false,
  meta: { composite: false, hidden: false, cancellable: false },
});
export const number = { name: "by", type: "integer", dynamic_value: false };
export const TYPES: State["types"] = {
  ...initialState().types,
  actions: {
    Device: [
      meta("ask", ["boolean"]),
      meta("count", ["integer"], [number]),
      meta("act", []),
      meta("show", [], [{ ...number, type: "string" }]),
    ],
  },
};

/**
 * Build a program: actions a, b, ... by their kinds, at one point; connections as [from, to, value of the result of
 * from], or ["a", "b", "on refused stale"] for an error exit. Actions with error exits name their error.
 */
export function program(
  kinds: Record<string, string>,
  steps: [string, string, string?][] = [],
  parameters: Record<string, object> = {},
): OpenDocument {
  const at = { x: 0, y: 0, z: 0 };
  const failing = new Set(steps.flatMap(([start, , value]) => (value?.startsWith("on ") ? [start] : [])));
  const actions = Object.entries(kinds).map(([id, kind]) => {
    const outputs = kind === "act" || kind === "show" ? [] : [`${id}_result`];
    const takes = kind === "count" || kind === "show";
    const given = takes ? [{ name: "by", type: "integer", value: "1", ...parameters[id] }] : [];
    const flows = [{ type: "default" as const, outputs }];
    const error = failing.has(id) ? { error_output: `${id}_error` } : {};
    return { id, name: id, type: `device/${kind}`, parameters: given, flows, ...error };
  });
  const logic = steps.map(
    ([start, end, value], index): LogicItem => ({
      id: `s${index}`,
      start,
      end,
      ...(value?.startsWith("on ")
        ? { error_kinds: value.split(" ").slice(1) }
        : value !== undefined && { condition: { what: `${start}/default/0`, value } }),
    }),
  );
  const scene: Scene = {
    id: "scene",
    name: "scene",
    description: "",
    objects: [{ id: "device", name: "device", type: "Device", parameters: [] }],
  };
  const project: Project = {
    id: "project",
    name: "project",
    scene_id: "scene",
    description: "",
    has_logic: true,
    action_points: [{ id: "point", name: "point", position: at, orientations: [], robot_joints: [], actions }],
    parameters: [{ id: "par", name: "so_many", type: "integer", value: "5" }],
    functions: [],
    logic,
    object_overrides: [],
  };
  return documentFrom(scene, project);
}
