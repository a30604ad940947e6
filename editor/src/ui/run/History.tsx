/** The run history, newest first. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, plural, t } from "@lingui/core/macro";
import { useState } from "react";
import { loadTiming, sentence, type Timing } from "../../commands/dryRun";
import { ago, duration } from "../../formats";
import { splitAddress } from "../../program/messages";
import type { Run, RunEnd } from "../../protocol/types";
import { isRunning } from "../../store/selectors";
import { notify, useEditor } from "../../store/store";
import { Gantt } from "../gantt/Gantt";
import { Button } from "../kit/kit";
import { OpenRecording } from "../recording/OpenRecording";
import { useRecordings } from "../recording/useRecordings";
import { useTicking } from "../times";
import { Facts } from "./DryRun";

const WORDS: Record<RunEnd, MessageDescriptor> = {
  running: msg`running`,
  finished: msg`finished`,
  stopped: msg`stopped`,
  failed: msg`failed`,
  lost: msg`interrupted`,
};
/** Return in words how a run ended. */
export const endName = (end: RunEnd): string => i18n._(WORDS[end]);
const TONES: Record<RunEnd, string> = { running: "good", finished: "good", stopped: "", failed: "bad", lost: "warn" };
const SHOWN = 10;

/** Show the newest runs of the open project, or of all projects if none is open; with `charts`, also their charts. */
export function History({ charts = false }: { charts?: boolean }) {
  const runs = useEditor((state) => state.program.runs);
  const recordings = useRecordings();
  // The operator's screen does not scroll during a run.
  const offered = useEditor((state) => charts || !isRunning(state));
  const project = useEditor((state) => state.doc?.project?.id);
  useTicking();
  const mine = runs.filter((each) => project === undefined || each.project_id === project).slice(0, SHOWN);
  if (mine.length === 0) return null;
  return (
    <section className="run-part" aria-label={t`Run history`}>
      <h3>{t`Runs`}</h3>
      <ul className="runs">
        {mine.map((each) => (
          <li key={each.number}>
            <span>
              <span className={`tag ${TONES[each.end]}`}>{endName(each.end)}</span> {ago(each.started)}
              {each.started_by && <span className="quiet"> {t`by ${each.started_by}`}</span>}
            </span>
            <span className="quiet small">{summary(each)}</span>
            {offered && (each.end === "failed" || each.end === "lost") && (
              <OpenRecording recording={recordings.find(({ run }) => run === each.number)} />
            )}
            {charts && each.end !== "running" && each.actions > 0 && <RunChart number={each.number} />}
          </li>
        ))}
      </ul>
    </section>
  );
}

/** A button that shows the chart of a run. */
function RunChart({ number }: { number: number }) {
  const [timing, setTiming] = useState<Timing | null>(null);
  const show = () => {
    if (timing) setTiming(null);
    else loadTiming(`run ${number}`).then(setTiming, (error: unknown) => notify("error", sentence(error)));
  };
  return (
    <div className="timing">
      <div className="row">
        <Button variant="plain" icon="list" aria-expanded={timing !== null} onPress={show}>
          {timing ? t`Hide chart` : t`Chart`}
        </Button>
      </div>
      {timing && (
        <>
          <Facts summary={timing.summary} />
          <Gantt name={t`Run ${number}`} trace={timing.trace} summary={timing.summary} span={timing.summary.cycle} />
        </>
      )}
    </div>
  );
}

function summary(run: Run): string {
  const took = run.ended ? (Date.parse(run.ended) - Date.parse(run.started)) / 1000 : undefined;
  if (run.end === "running") return run.start_paused ? t`started paused` : "";
  const parts = [plural(run.actions, { one: "# action", other: "# actions" })];
  if (took !== undefined) parts.push(duration(took));
  if (run.stopped_by) parts.push(t`stopped by ${run.stopped_by}`);
  const error = splitAddress(run.error ?? "").text;
  if (error) parts.push(run.last_action?.name ? `${run.last_action.name}: ${error}` : error);
  return parts.join(" · ");
}
