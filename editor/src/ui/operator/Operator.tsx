/**
 * The screen of who runs the machine: what it does, start and stop, and in plain words what went wrong. At
 * `/#/operator`; `/#/operator?kiosk` has no way out of it. Needs no more than the operator's role.
 */

import { useState } from "react";
import { barred } from "../../commands/asking";
import * as commands from "../../commands/run";
import { isRunning } from "../../store/selectors";
import { now, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { nameOf, withNames } from "../names";
import { Notices } from "../notices/Notices";
import { People } from "../people/People";
import { History } from "../run/History";
import { RunButtons, STATES } from "../run/RunBar";
import { Settings } from "../settings/Settings";
import "../run/run.css";
import "./operator.css";

export default function Operator({ kiosk }: { kiosk: boolean }) {
  const state = useEditor((each) => each);
  const { program, lists, live, doc } = state;
  const runs = isRunning(state);
  const packages = [...(lists.packages ?? [])].sort((a, b) => b.package_meta.built.localeCompare(a.package_meta.built));
  const [chosen, setChosen] = useState("");
  const [starting, setStarting] = useState(false);
  const known = packages.find((each) => each.id === chosen) ?? packages.find((each) => each.id === program.packageId) ?? packages[0];
  const run = program.runs[0];
  const broken = !runs && (program.exception !== null || (program.state !== "undefined" && run?.end === "failed"));
  const tone = runs ? (program.state === "paused" ? "paused" : "running") : broken ? "broken" : "idle";
  const why = !known
    ? "There is no package yet: build one in the editor."
    : doc && !runs
      ? `${doc.project?.name ?? doc.scene.name} is open in the editor: close it first.`
      : barred(state, "RunPackage");
  const start = async () => {
    if (!known) return;
    setStarting(true);
    await commands.runPackage(known.id);
    setStarting(false);
  };
  const doing = program.running.map((id) => nameOf(state, id)).filter(Boolean).join(", ");
  return (
    <div className="operator" data-tone={tone}>
      <header className="bar">
        {!kiosk && (
          <Button look="plain" icon="home" aria-label="To the editor" onPress={() => (location.hash = "")} />
        )}
        <h1>{runs ? program.packageName || "A program" : "Operator"}</h1>
        <People />
        <Settings />
      </header>
      <main>
        <section className="operator-state" aria-label="State" role="status">
          <Icon name={tone === "broken" ? "warn" : tone === "running" ? "play" : tone === "paused" ? "pause" : "check"} size={56} />
          <div>
            <p className="operator-word">{starting ? "Starting…" : runs ? STATES[program.state] : broken ? "It stopped with an error" : live.state === "started" ? "Devices are in use by the editor" : "Ready"}</p>
            {doing && (
              <p>
                {program.state === "paused" ? "before " : ""}
                {doing}
              </p>
            )}
          </div>
        </section>
        {broken && <Trouble />}
        <Devices />
        {runs ? (
          <div className="operator-buttons">
            <RunButtons />
          </div>
        ) : (
          <section className="operator-start" aria-label="Start">
            <ul className="operator-packages" role="radiogroup" aria-label="What is run">
              {packages.map((each) => (
                <li key={each.id}>
                  <label className="operator-package" data-selected={each.id === known?.id}>
                    <input type="radio" className="hidden-but-read" name="package" checked={each.id === known?.id} onChange={() => setChosen(each.id)} />
                    <strong>{each.package_meta.name}</strong>
                    <span className="quiet small">{each.project_meta ? `from ${each.project_meta.name}` : ""}</span>
                  </label>
                </li>
              ))}
              {packages.length === 0 && <p className="quiet">There is no package yet. Who programs the machine builds one in the editor, under Run.</p>}
            </ul>
            <Button look="primary" icon="play" className="operator-go" why={why} isDisabled={starting} onPress={() => void start()}>
              Start
            </Button>
          </section>
        )}
        <History />
      </main>
      <Notices />
    </div>
  );
}

/** What ended the last run, and what to do. */
function Trouble() {
  const exception = useEditor((state) => state.program.exception);
  const run = useEditor((state) => state.program.runs[0]);
  const message = exception?.message ?? run?.error ?? "";
  const where = run?.last_action?.name;
  return (
    <section className="exception" role="alert">
      <p>
        <Icon name="warn" /> <strong>{where ? `It failed in ${where}` : "It failed"}</strong>
      </p>
      <p>{withNames(now(), message)}</p>
      <p className="quiet small">See to the cause, then press Start. If it fails again, call who programs the machine.</p>
    </section>
  );
}

/** Devices that are in trouble, by their names; nothing while all is well. */
function Devices() {
  const live = useEditor((state) => state.live);
  const doc = useEditor((state) => state.doc);
  const wrong = Object.values(live.objects).filter((each) => each.state === "lost" || each.state === "failed" || each.answering === false);
  if (!doc || wrong.length === 0) return null;
  return (
    <section className="exception" role="alert">
      {wrong.map((each) => (
        <p key={each.object_id}>
          <Icon name="plug" /> <strong>{doc.objects[each.object_id]?.name ?? "A device"} does not answer.</strong> {each.reason}
        </p>
      ))}
    </section>
  );
}
