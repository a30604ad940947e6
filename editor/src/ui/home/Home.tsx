/** The home screen: scenes, projects and packages. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { Input, Label, SearchField, ToggleButton, ToggleButtonGroup } from "react-aria-components";
import { storeGeneralState } from "../../commands/viewstate";
import { chosen, type Entry, entriesOf, SORTS, type Sort } from "../../home/entries";
import { whyUnavailable } from "../../store/permissions";
import type { State } from "../../store/state";
import { useEditor } from "../../store/store";
import { CellName } from "../cell/CellName";
import { Button, Waiting } from "../kit/kit";
import { Notices } from "../notices/Notices";
import { People } from "../people/People";
import { Settings } from "../settings/Settings";
import { Card } from "./Card";
import { favoritesOf } from "./favorites";
import { NewProject } from "./NewProject";
import { NewScene } from "./NewScene";
import { recentOf } from "./recent";
import { Start } from "./Start";
import { UploadPackage } from "./UploadPackage";
import "./home.css";

const TABS = ["projects", "scenes", "packages"] as const;
type TabName = (typeof TABS)[number];
const TITLES: Record<TabName, MessageDescriptor> = {
  projects: msg`Projects`,
  scenes: msg`Scenes`,
  packages: msg`Packages`,
};
const EMPTY: Record<TabName, MessageDescriptor> = {
  projects: msg`No projects yet. A project is a program for a scene. Create a scene first.`,
  scenes: msg`No scenes yet. A scene contains the devices of a workplace and their poses.`,
  packages: msg`No packages yet. A package is a built project, ready to run.`,
};
const KINDS: Record<TabName, Entry["kind"]> = { projects: "project", scenes: "scene", packages: "package" };
const TAB_OF: Record<Entry["kind"], TabName> = { project: "projects", scene: "scenes", package: "packages" };
const SHOWN: Record<State["lists"]["shown"], TabName> = {
  ProjectsList: "projects",
  ScenesList: "scenes",
  PackagesList: "packages",
};

export function Home() {
  const lists = useEditor((state) => state.lists);
  const noRight = useEditor((state) => whyUnavailable(state, "NewProject"));
  const noScene = useEditor((state) => whyUnavailable(state, "NewScene"));
  const [tab, setTab] = useState<TabName>(SHOWN[lists.shown]);
  const [search, setSearch] = useState("");
  const [asking, setAsking] = useState<"" | "scene" | "project">("");
  const [scene, setScene] = useState("");
  const [onlyStars, setOnlyStars] = useState(false);
  const stars = useEditor(favoritesOf);
  const sort = useEditor(sortOf);
  const recent = useEditor(recentOf);
  const entries = Object.fromEntries(TABS.map((each) => [each, entriesOf(lists, KINDS[each])])) as Record<
    TabName,
    Entry[] | null
  >;
  const here = entries[tab];
  const noProject = noRight || (lists.scenes?.length ? "" : t`Create a scene first.`);
  return (
    <div className="home">
      <header className="bar">
        <CellName />
        <h1>{t`Workplace`}</h1>
        <Button
          variant="plain"
          icon="play"
          aria-label={t`Operator`}
          className="to-operator"
          onPress={() => (location.hash = "#/operator")}
        >
          <span>{t`Operator`}</span>
        </Button>
        <People />
        <Settings />
      </header>
      <main>
        <Start />
        <div className="home-tools">
          <ToggleButtonGroup
            className="tabs"
            aria-label={t`Lists`}
            selectionMode="single"
            disallowEmptySelection
            selectedKeys={[tab]}
            onSelectionChange={(keys) => setTab([...keys][0] as TabName)}
          >
            {TABS.map((each) => (
              <ToggleButton key={each} id={each} className="tab">
                {i18n._(TITLES[each])} <span className="tag">{entries[each]?.length ?? "…"}</span>
              </ToggleButton>
            ))}
          </ToggleButtonGroup>
          <SearchField className="field search" value={search} onChange={setSearch}>
            <Label className="hidden-but-read">{t`Search`}</Label>
            <Input placeholder={t`Search by name or description`} />
          </SearchField>
          <div className="field sorting">
            <label htmlFor="sort">{t`Sort by`}</label>
            <select id="sort" value={sort} onChange={(event) => storeGeneralState({ sort: event.target.value })}>
              {SORTS.map(([each, words]) => (
                <option key={each} value={each}>
                  {i18n._(words)}
                </option>
              ))}
            </select>
          </div>
          <Button aria-pressed={onlyStars} aria-label={t`Favorites only`} onPress={() => setOnlyStars(!onlyStars)}>
            <span aria-hidden="true">{onlyStars ? "★" : "☆"}</span>
          </Button>
          {tab === "scenes" && (
            <Button variant="primary" icon="plus" why={noScene} onPress={() => setAsking("scene")}>
              {t`New scene`}
            </Button>
          )}
          {tab === "projects" && (
            <Button
              variant="primary"
              icon="plus"
              why={noProject}
              onPress={() => {
                setScene("");
                setAsking("project");
              }}
            >
              {t`New project`}
            </Button>
          )}
          {tab === "packages" && <UploadPackage />}
        </div>
        <section aria-label={i18n._(TITLES[tab])}>
          <Cards
            entries={here}
            found={chosen(here ?? [], search, sort, onlyStars ? stars : null, recent)}
            search={search}
            empty={i18n._(EMPTY[tab])}
            highlight={lists.highlight}
            onRelated={(kind, name) => {
              setTab(TAB_OF[kind]);
              setSearch(name);
              setOnlyStars(false);
            }}
            onProject={(id) => {
              setScene(id);
              setAsking("project");
            }}
          />
        </section>
      </main>
      <Notices />
      {asking === "scene" && <NewScene onClose={() => setAsking("")} />}
      {asking === "project" && <NewProject initial={scene} onClose={() => setAsking("")} />}
    </div>
  );
}

/** Sort order of the user, stored on the server. */
function sortOf(state: State): Sort {
  const stored = state.view.general.sort;
  return SORTS.find(([each]) => each === stored)?.[0] ?? "changed";
}

interface ListProps {
  entries: Entry[] | null;
  found: Entry[];
  search: string;
  empty: string;
  highlight: string;
  onRelated: (kind: Entry["kind"], search: string) => void;
  onProject: (scene: string) => void;
}

function Cards({ entries, found, search, empty, highlight, onRelated, onProject }: ListProps) {
  if (entries === null) return <Waiting>{t`Loading…`}</Waiting>;
  if (entries.length === 0) return <p className="empty quiet">{empty}</p>;
  if (found.length === 0)
    return (
      <p className="empty quiet">
        {search.trim() ? t`No match for “${search.trim()}”.` : t`No favorites yet. Tap the star of an entry.`}
      </p>
    );
  const taken = entries.map((each) => each.name);
  return (
    <ul className="cards">
      {found.map((each) => (
        <Card
          key={each.id}
          entry={each}
          marked={each.id === highlight}
          taken={taken}
          onRelated={onRelated}
          onProject={onProject}
        />
      ))}
    </ul>
  );
}
