/** Run the open project and follow it: state, result, and each action with its parameters and results. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { notEditable } from "../../commands/program";
import { breakAt, build, notRunnable, run } from "../../commands/run";
import { doingWords } from "../../program/position";
import { whyUnavailable } from "../../store/permissions";
import { isRunning } from "../../store/selectors";
import { select, setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import { AskName } from "../kit/lazyControls";
import PartsCard from "../parts/PartsCard";
import { DryRun } from "./DryRun";
import { History } from "./History";
import { LastResult } from "./Result";
import { phaseName, RunButtons } from "./RunBar";
import { Trace } from "./Trace";
import "./run.css";

export default function RunPanel() {
  const state = useEditor((each) => each);
  const [asking, setAsking] = useState(false);
  const [busy, setBusy] = useState(false);
  const { doc, program, breakpoints } = state;
  const runs = isRunning(state);
  const why = notRunnable(state);
  const cannotBuild = notEditable(state, "BuildProject");
  const begin = async (paused: boolean) => {
    setBusy(true);
    await run({ paused });
    setBusy(false);
  };
  const doing = doingWords(state);
  const broken = Object.keys(breakpoints).filter((id) => nameOf(state, id));
  return (
    <>
      {!runs && <PartsCard />}
      {!runs && !busy && doc?.project && <LastResult projectId={doc.project.id} />}
      {(runs || busy) && (
        <p className="run-state" role="status">
          <strong>{runs ? phaseName(program) : t`Building…`}</strong>
          {program.running.length > 0 && <span> {program.state === "paused" ? t`before ${doing}` : doing}</span>}
        </p>
      )}
      {runs ? (
        <div className="row">
          <RunButtons />
        </div>
      ) : (
        <>
          <div className="row">
            <Button variant="primary" icon="play" why={why} isDisabled={busy} onPress={() => void begin(false)}>
              {doc?.unsaved ? t`Save and run` : t`Run`}
            </Button>
            <Button icon="step" why={why} isDisabled={busy} onPress={() => void begin(true)}>
              {t`Start paused`}
            </Button>
            <Button icon="box" why={cannotBuild} isDisabled={busy} onPress={() => setAsking(true)}>
              {t`Build…`}
            </Button>
          </div>
          <p className="quiet small">
            {doc?.unsaved && `${t`Unsaved changes are saved first.`} `}
            {t`“Build” creates a package for the operator screen.`}
          </p>
        </>
      )}
      {broken.length > 0 && (
        <section className="run-part" aria-label={t`Breakpoints`}>
          <h3>{t`Pauses before`}</h3>
          <ul className="row">
            {broken.map((id) => (
              <li key={id}>
                <Button
                  variant="plain"
                  icon="close"
                  aria-label={t`Remove breakpoint at ${nameOf(state, id)}`}
                  why={whyUnavailable(state, "SetBreakpoints")}
                  onPress={() => void breakAt(id, false)}
                >
                  {nameOf(state, id)}
                </Button>
              </li>
            ))}
          </ul>
        </section>
      )}
      <Follow />
      <Trace
        onChoose={(id) => {
          setUi({ tool: "" });
          select({ kind: "action", id });
        }}
      />
      <DryRun />
      <History charts />
      {asking && doc?.project && (
        <AskName
          title={t`Build a package`}
          initial={doc.project.name}
          confirmLabel={doc.unsaved ? t`Save and build` : t`Build`}
          onConfirm={(name) => void build(name)}
          onClose={() => setAsking(false)}
        />
      )}
    </>
  );
}

/** Whether the camera follows the running action. */
function Follow() {
  const on = useEditor((state) => state.ui.follow);
  return (
    <label className="check">
      <input type="checkbox" checked={on} onChange={(event) => setUi({ follow: event.target.checked })} />
      <span>{t`Follow the running action`}</span>
    </label>
  );
}
