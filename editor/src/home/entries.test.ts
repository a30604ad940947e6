import { afterEach, describe, expect, it } from "vitest";
import { setTranslations } from "../i18n/testing";
import type { Lists } from "../store/state";
import { chosen, entriesOf } from "./entries";

const scene = (id: string, name: string, modified: string) => ({
  id,
  name,
  created: "2026-01-01T00:00:00Z",
  modified,
  description: "",
});
const LISTS: Lists = {
  scenes: [scene("s1", "cell 10", "2026-03-01T00:00:00Z"), scene("s2", "cell 2", "2026-04-01T00:00:00Z")],
  projects: [
    { id: "p1", name: "sort", scene_id: "s1", description: "boards", has_logic: true, problems: ["no end"] },
    { id: "p2", name: "lost", scene_id: "gone", description: "", has_logic: true },
  ],
  packages: [
    {
      id: "k1",
      package_meta: { name: "sort 1", built: "2026-04-02T00:00:00Z" },
      project_meta: { id: "p9", name: "old", description: "", modified: "2026-04-01T00:00:00Z" },
    },
  ],
  shown: "ProjectsList",
  highlight: "",
};

afterEach(() => setTranslations({}));

describe("the lists of the home screen", () => {
  it("show problems in the user's language, and keep the English text for the repair", () => {
    setTranslations({ "{name}: {type} needs a pose.": "{name}: {type} potřebuje polohu." });
    const text = "lamp: Lamp needs a pose.";
    const message = { text, key: "{name}: {type} needs a pose.", values: { name: "lamp", type: "Lamp" } };
    const faulty = { ...scene("s3", "cell 3", "2026-05-01T00:00:00Z"), problems: [text], problem_messages: [message] };
    const [entry] = entriesOf({ ...LISTS, scenes: [faulty] }, "scene") ?? [];
    expect(entry).toMatchObject({ problems: [text], explanations: ["lamp: Lamp potřebuje polohu."] });
    expect(entriesOf(LISTS, "project")?.map((each) => each.explanations)).toEqual([["no end"], []]);
  });

  it("name related entries, also deleted ones", () => {
    expect(entriesOf(LISTS, "scene")?.map((each) => each.projects)).toEqual([1, 0]);
    expect(entriesOf(LISTS, "project")?.map((each) => each.from)).toEqual([
      { id: "s1", name: "cell 10", gone: false },
      { id: "gone", name: "a deleted scene", gone: true },
    ]);
    expect(entriesOf(LISTS, "package")?.[0]).toMatchObject({ executed: "", from: { name: "old", gone: true } });
    expect(entriesOf({ ...LISTS, scenes: null }, "scene")).toBeNull();
  });

  it("are sorted naturally, and searched by name, description and related entry", () => {
    const scenes = entriesOf(LISTS, "scene") ?? [];
    expect(chosen(scenes, "", "name", null).map((each) => each.name)).toEqual(["cell 2", "cell 10"]);
    expect(chosen(scenes, "", "name down", null).map((each) => each.name)).toEqual(["cell 10", "cell 2"]);
    expect(chosen(scenes, "", "changed", null).map((each) => each.id)).toEqual(["s2", "s1"]);
    expect(chosen(scenes, "", "oldest", null).map((each) => each.id)).toEqual(["s1", "s2"]);
    expect(chosen(scenes, "", "recent", null, ["s1"]).map((each) => each.id)).toEqual(["s1", "s2"]);
    expect(chosen(scenes, "", "recent", null).map((each) => each.id)).toEqual(["s2", "s1"]);
    const projects = entriesOf(LISTS, "project") ?? [];
    expect(chosen(projects, "BOARD", "name", null).map((each) => each.id)).toEqual(["p1"]);
    expect(chosen(projects, "cell 10", "name", null).map((each) => each.id)).toEqual(["p1"]);
    expect(chosen(projects, "", "name", new Set(["p2"])).map((each) => each.id)).toEqual(["p2"]);
  });
});
