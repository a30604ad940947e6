/** The run history, newest first. */

import type { Run, RunEnd } from "../../protocol/types";
import { useEditor } from "../../store/store";
import { ago, useTicking } from "../times";
import { seconds } from "./Trace";

export const WORDS: Record<RunEnd, string> = {
  running: "running",
  finished: "finished",
  stopped: "stopped",
  failed: "failed",
  lost: "interrupted",
};
const TONES: Record<RunEnd, string> = { running: "good", finished: "good", stopped: "", failed: "bad", lost: "warn" };
const SHOWN = 10;

/** Show the newest runs of the open project, or of all projects if none is open. */
export function History() {
  const runs = useEditor((state) => state.program.runs);
  const project = useEditor((state) => state.doc?.project?.id);
  useTicking();
  const mine = runs.filter((each) => project === undefined || each.project_id === project).slice(0, SHOWN);
  if (mine.length === 0) return null;
  return (
    <section className="run-part" aria-label="Run history">
      <h3>Runs</h3>
      <ul className="runs">
        {mine.map((each) => (
          <li key={each.number}>
            <span>
              <span className={`tag ${TONES[each.end]}`}>{WORDS[each.end]}</span> {ago(each.started)}
              {each.started_by && <span className="quiet"> by {each.started_by}</span>}
            </span>
            <span className="quiet small">{summary(each)}</span>
          </li>
        ))}
      </ul>
    </section>
  );
}

function summary(run: Run): string {
  const took = run.ended ? (Date.parse(run.ended) - Date.parse(run.started)) / 1000 : undefined;
  if (run.end === "running") return run.start_paused ? "started paused" : "";
  const parts = [`${run.actions} ${run.actions === 1 ? "action" : "actions"}`];
  if (took !== undefined) parts.push(seconds(took));
  if (run.stopped_by) parts.push(`stopped by ${run.stopped_by}`);
  if (run.error) parts.push(`in ${run.last_action?.name || "an action"}: ${run.error}`);
  return parts.join(" · ");
}
