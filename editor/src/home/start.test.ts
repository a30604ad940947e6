import { expect, test } from "vitest";
import { initialState } from "../store/state";
import { proposalOf } from "./start";

const entry = (id: string, modified = "", problems: string[] = []) => ({
  has_logic: true,
  id,
  name: id,
  description: "",
  scene_id: "s1",
  created: modified,
  modified,
  problems,
});

test("home proposes the document that the user opened last, then the newest project, then a new one", () => {
  const { lists } = initialState();
  expect(proposalOf(lists, [])).toBeNull();
  expect(proposalOf({ ...lists, scenes: [], projects: [] }, [])).toEqual({ kind: "empty" });
  const full = {
    ...lists,
    scenes: [entry("s1")],
    projects: [entry("old", "2026-01-01"), entry("new", "2026-02-01"), entry("broken", "2026-03-01", ["x"])],
  };
  expect(proposalOf(full, [])).toEqual({ kind: "start", document: "project", id: "new", name: "new" });
  expect(proposalOf(full, ["deleted", "s1", "old"])).toEqual({
    kind: "continue",
    document: "scene",
    id: "s1",
    name: "s1",
  });
  expect(proposalOf({ ...full, projects: [] }, [])).toBeNull();
});
