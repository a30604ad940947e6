/** Ask for the name and the scene of a new project. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import * as documents from "../../commands/documents";
import { useEditor } from "../../store/store";
import { AskName } from "../kit/lazyControls";
import { StartFrom } from "./StartFrom";

export function NewProject({ initial = "", onClose }: { initial?: string; onClose: () => void }) {
  const scenes = useEditor((state) => state.lists.scenes) ?? [];
  const projects = useEditor((state) => state.lists.projects) ?? [];
  const newest = [...scenes].sort((a, b) => (b.modified ?? "").localeCompare(a.modified ?? ""))[0];
  const [scene, setScene] = useState(initial || (newest?.id ?? ""));
  const [logic, setLogic] = useState(true);
  const [from, setFrom] = useState("");
  const make = (name: string) =>
    void (from ? documents.fromTemplate("project", from, name) : documents.newProject(scene, name, "", logic));
  return (
    <AskName
      title={t`New project`}
      confirmLabel={t`Create`}
      taken={projects.map((each) => each.name)}
      onConfirm={make}
      onClose={onClose}
    >
      <StartFrom of={projects} value={from} onChange={setFrom} />
      {!from && (
        <>
          <div className="field">
            <label htmlFor="scene-of-project">{t`Scene`}</label>
            <select id="scene-of-project" value={scene} onChange={(event) => setScene(event.target.value)}>
              {scenes.map((each) => (
                <option key={each.id} value={each.id}>
                  {each.name}
                </option>
              ))}
            </select>
          </div>
          <label className="check">
            <input type="checkbox" checked={logic} onChange={(event) => setLogic(event.target.checked)} />
            <span>
              {t`Connect the actions in the editor`}
              <span className="quiet small"> {t`– if off, the project only stores points for your own script`}</span>
            </span>
          </label>
        </>
      )}
    </AskName>
  );
}
