/** One scene, project or package, with what can be done to it. */

import { useState } from "react";
import { ask, barred } from "../../commands/asking";
import * as documents from "../../commands/documents";
import type { Requests } from "../../protocol/types";
import { now, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { AskName, Button, type Choice, Confirm, More } from "../kit/kit";
import { ago } from "../times";

export interface Entry {
  kind: "scene" | "project" | "package";
  id: string;
  name: string;
  description: string;
  detail: string;
  /** When it was changed or built, RFC 3339. */
  time: string;
  problems: string[];
}

const DO: Record<Entry["kind"], Partial<Record<"open" | "copy" | "rename" | "remove", keyof Requests>>> = {
  scene: { open: "OpenScene", copy: "CopyScene", rename: "RenameScene", remove: "DeleteScene" },
  project: { open: "OpenProject", copy: "CopyProject", rename: "RenameProject", remove: "DeleteProject" },
  package: { open: "RunPackage", rename: "RenamePackage", remove: "DeletePackage" },
};

export function Card({ entry, marked }: { entry: Entry; marked: boolean }) {
  const { kind, id, name, problems } = entry;
  const [asking, setAsking] = useState<"" | "copy" | "rename" | "remove">("");
  const [needing, setNeeding] = useState<string[]>([]);
  const connection = useEditor((state) => state.connection);
  const owner = useEditor((state) => state.locks[id]);
  const why = (what: keyof (typeof DO)["scene"]) => {
    const request = DO[kind][what];
    return request ? barred({ ...now(), connection }, request) : "";
  };
  const open = () => (kind === "scene" ? documents.openScene(id) : kind === "project" ? documents.openProject(id) : ask("RunPackage", { id }));
  const choices: Choice[] = [
    ...(kind === "package" ? [] : [{ id: "copy", label: "Duplicate…", not: why("copy"), act: () => setAsking("copy") }]),
    { id: "rename", label: "Rename…", not: owner && owner !== connection.user ? `${owner} holds it` : why("rename"), act: () => setAsking("rename") },
    {
      id: "remove",
      label: "Delete…",
      not: why("remove"),
      act: () => {
        if (kind === "scene") void documents.projectsOf(id).then(setNeeding, () => setNeeding([]));
        setAsking("remove");
      },
    },
  ];
  const close = () => setAsking("");
  return (
    <li className="card" data-marked={marked} data-id={id}>
      <div className="card-text">
        <h2>{name}</h2>
        <p className="quiet small">
          {entry.detail}
          {entry.time && ` · ${kind === "package" ? "built" : "changed"} ${ago(entry.time)}`}
        </p>
        {entry.description && <p className="small description">{entry.description}</p>}
        {problems.length > 0 && (
          <details className="problems">
            <summary>
              <span className="tag bad">
                <Icon name="warn" size={16} /> {problems.length === 1 ? "1 problem" : `${problems.length} problems`}
              </span>
            </summary>
            <ul>
              {problems.map((each) => (
                <li key={each}>{each}</li>
              ))}
            </ul>
          </details>
        )}
      </div>
      <div className="card-actions">
        <Button look="primary" icon={kind === "package" ? "play" : undefined} isDisabled={why("open") !== ""} onPress={() => void open()} aria-label={`${kind === "package" ? "Run" : "Open"} ${name}`}>
          {kind === "package" ? "Run" : "Open"}
        </Button>
        <More label={`More about ${name}`} choices={choices} />
      </div>
      {asking === "rename" && <AskName title={`Rename ${name}`} initial={name} yes="Rename" onClose={close} onYes={(to) => void (kind === "scene" ? documents.renameScene(id, to) : kind === "project" ? documents.renameProject(id, to) : documents.renamePackage(id, to))} />}
      {asking === "copy" && <AskName title={`Duplicate ${name}`} initial={`${name} copy`} yes="Duplicate" onClose={close} onYes={(to) => void (kind === "scene" ? documents.duplicateScene(id, to) : documents.duplicateProject(id, to))} />}
      {asking === "remove" && (
        <Confirm title={`Delete ${name}?`} yes="Delete" onClose={close} onYes={() => void (kind === "scene" ? documents.deleteScene(id) : kind === "project" ? documents.deleteProject(id) : documents.deletePackage(id))}>
          {needing.length > 0 ? (
            <>
              <p>These projects are on this scene, and have to be deleted first:</p>
              <ul>
                {needing.map((each) => (
                  <li key={each}>{each}</li>
                ))}
              </ul>
            </>
          ) : (
            <p>This cannot be undone.</p>
          )}
        </Confirm>
      )}
    </li>
  );
}
