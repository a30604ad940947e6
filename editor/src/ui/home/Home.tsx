/** What there is to open: scenes, projects, packages, kept up to date by the server's events. */

import { useState } from "react";
import { Input, Label, SearchField, ToggleButton, ToggleButtonGroup } from "react-aria-components";
import * as documents from "../../commands/documents";
import { barred } from "../../commands/asking";
import { type State } from "../../store/state";
import { useEditor } from "../../store/store";
import { AskName, Button, Waiting } from "../kit/kit";
import { People } from "../people/People";
import { Settings } from "../settings/Settings";
import { Notices } from "../notices/Notices";
import { NewProject } from "./NewProject";
import { Card, type Entry } from "./Card";
import "./home.css";

const TABS = ["projects", "scenes", "packages"] as const;
type TabName = (typeof TABS)[number];
const TITLES: Record<TabName, string> = { projects: "Projects", scenes: "Scenes", packages: "Packages" };
const EMPTY: Record<TabName, string> = {
  projects: "No project yet. A project is a program for a scene: make a scene first, then a project on it.",
  scenes: "No scene yet. A scene says which devices stand in the workplace, and where.",
  packages: "No package yet. A package is a project that was built, ready to be run.",
};
const SHOWN: Record<State["lists"]["shown"], TabName> = { ProjectsList: "projects", ScenesList: "scenes", PackagesList: "packages" };

export function Home() {
  const lists = useEditor((state) => state.lists);
  const noProject = useEditor((state) => barred(state, "NewProject"));
  const noScene = useEditor((state) => barred(state, "NewScene"));
  const [tab, setTab] = useState<TabName>(SHOWN[lists.shown]);
  const [search, setSearch] = useState("");
  const [asking, setAsking] = useState<"" | "scene" | "project">("");
  const entries = { projects: ofProjects(lists), scenes: ofScenes(lists), packages: ofPackages(lists) };
  return (
    <div className="home">
      <header className="bar">
        <h1>Workplace</h1>
        <Button look="plain" icon="play" onPress={() => (location.hash = "#/operator")}>
          Operator
        </Button>
        <People />
        <Settings />
      </header>
      <main>
        <div className="home-tools">
          <ToggleButtonGroup
            className="tabs"
            aria-label="What is listed"
            selectionMode="single"
            disallowEmptySelection
            selectedKeys={[tab]}
            onSelectionChange={(keys) => setTab([...keys][0] as TabName)}
          >
            {TABS.map((each) => (
              <ToggleButton key={each} id={each} className="tab">
                {TITLES[each]} <span className="tag">{entries[each]?.length ?? "…"}</span>
              </ToggleButton>
            ))}
          </ToggleButtonGroup>
          <SearchField className="field search" value={search} onChange={setSearch}>
            <Label className="hidden-but-read">Search</Label>
            <Input placeholder="Search by name or description" />
          </SearchField>
          {tab === "scenes" && (
            <Button look="primary" icon="plus" isDisabled={noScene !== ""} onPress={() => setAsking("scene")}>
              New scene
            </Button>
          )}
          {tab === "projects" && (
            <Button
              look="primary"
              icon="plus"
              isDisabled={noProject !== "" || !lists.scenes?.length}
              onPress={() => setAsking("project")}
            >
              New project
            </Button>
          )}
        </div>
        <section aria-label={TITLES[tab]}>
          <Cards entries={entries[tab]} search={search} empty={EMPTY[tab]} highlight={lists.highlight} />
        </section>
      </main>
      <Notices />
      {asking === "scene" && (
        <AskName title="New scene" yes="Make and open" taken={lists.scenes?.map((each) => each.name) ?? []} onYes={(name) => void documents.newScene(name)} onClose={() => setAsking("")} />
      )}
      {asking === "project" && <NewProject onClose={() => setAsking("")} />}
    </div>
  );
}

function Cards({ entries, search, empty, highlight }: { entries: Entry[] | null; search: string; empty: string; highlight: string }) {
  if (entries === null) return <Waiting>Reading the list…</Waiting>;
  if (entries.length === 0) return <p className="empty quiet">{empty}</p>;
  const wanted = search.trim().toLowerCase();
  const found = entries.filter((each) => `${each.name} ${each.detail} ${each.description}`.toLowerCase().includes(wanted));
  if (found.length === 0) return <p className="empty quiet">Nothing is called “{search.trim()}”.</p>;
  return (
    <ul className="cards">
      {found
        .sort((a, b) => b.time.localeCompare(a.time))
        .map((each) => (
          <Card key={each.id} entry={each} marked={each.id === highlight} />
        ))}
    </ul>
  );
}

function ofScenes({ scenes, projects }: State["lists"]): Entry[] | null {
  return (
    scenes?.map((scene) => ({
      kind: "scene",
      id: scene.id,
      name: scene.name,
      description: scene.description ?? "",
      detail: count(projects?.filter((each) => each.scene_id === scene.id).length ?? 0, "project"),
      time: scene.modified ?? "",
      problems: scene.problems ?? [],
    })) ?? null
  );
}

function ofProjects({ projects, scenes }: State["lists"]): Entry[] | null {
  return (
    projects?.map((project) => ({
      kind: "project",
      id: project.id,
      name: project.name,
      description: project.description,
      detail: `on ${scenes?.find((each) => each.id === project.scene_id)?.name ?? "a scene that is gone"}`,
      time: project.modified ?? "",
      problems: project.problems ?? [],
    })) ?? null
  );
}

function ofPackages({ packages }: State["lists"]): Entry[] | null {
  return (
    packages?.map((each) => ({
      kind: "package",
      id: each.id,
      name: each.package_meta.name,
      description: each.project_meta ? `from ${each.project_meta.name}` : "",
      detail: each.package_meta.executed ? "has run" : "has not run yet",
      time: each.package_meta.built,
      problems: [],
    })) ?? null
  );
}

export function count(number: number, word: string): string {
  return `${number} ${word}${number === 1 ? "" : "s"}`;
}
