import { expect, test } from "vitest";
import { documentFrom } from "../store/document";
import { initialState, type State } from "../store/state";
import { notEditable } from "./program";

test("a program cannot be edited while the server has closed its project for a run", () => {
  const scene = { id: "scn", name: "cell", description: "", objects: [] };
  const project = {
    ...{ id: "pro", name: "sort", scene_id: "scn", description: "", has_logic: true },
    ...{ action_points: [], parameters: [], functions: [], logic: [], object_overrides: [] },
  };
  const state = initialState();
  const connection: State["connection"] = { ...state.connection, status: "ready" };
  const doc = documentFrom(scene, project);
  expect(notEditable({ ...state, connection, doc }, "RemoveAction")).toBe("");
  expect(notEditable({ ...state, connection, doc: { ...doc, closed: true } }, "RemoveAction")).not.toBe("");
});
