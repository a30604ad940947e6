/** The dry run: predicted cycle time, chart, bottleneck, waits, first problem, and a comparison with other runs. */

import { t } from "@lingui/core/macro";
import { useEffect, useMemo, useState } from "react";
import {
  cancelDryRun,
  loadTiming,
  notPredictable,
  sentence,
  showDryRun,
  startDryRun,
  type Timing,
} from "../../commands/dryRun";
import { clock, decimal, duration, fixed } from "../../formats";
import { branchings, existingChoices } from "../../program/branchings";
import type { GetDryRunData, Prediction, TraceSummary } from "../../protocol/types";
import { notify, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Gantt } from "../gantt/Gantt";
import { SelectField } from "../kit/fields";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { ShowAction } from "./Result";

/** Numbers of shown waits, and of shown differences. */
const WAITS = 3;
const DIFFERENCES = 20;
/** Number of runs to compare with. */
const RUNS = 10;

export function DryRun() {
  const state = useEditor((each) => each);
  const found = state.program.dryRun;
  const project = state.doc?.project?.id;
  const head = found?.dry_run;
  const mine = head !== undefined && head.project_id === project;
  const first = (mine && head.from_action) || "";
  const from = first && nameOf(state, first);
  const running = mine && head.state === "running";
  const why = notPredictable(state);
  const { branches, fields } = useBranches();
  // The events of a dry run do not contain its result.
  const ended = running ? 0 : (head?.number ?? 0);
  useEffect(() => void showDryRun(project, ended), [project, ended]);
  const task = Object.values(state.tasks).find(
    (each) => each.state === "running" && each.title_message?.key === "Dry run of {name}",
  );
  return (
    <section className="run-part timing" aria-label={t`Dry run`}>
      <h3>{t`Dry run`}</h3>
      {running ? (
        <>
          <progress aria-label={t`Dry run`} {...(task?.progress === undefined ? {} : { value: task.progress })} />
          <div className="row">
            <Button icon="close" why={why} onPress={() => void cancelDryRun()}>{t`Cancel`}</Button>
          </div>
        </>
      ) : (
        <>
          <div className="row">
            <Button icon="eye" why={why} onPress={() => void startDryRun({ branches })}>{t`Dry run`}</Button>
            {from && (
              <Button why={why} onPress={() => void startDryRun({ branches, from_action: first })}>
                {t`Dry run from ${from}`}
              </Button>
            )}
          </div>
          {fields}
        </>
      )}
      {!mine && <p className="quiet small">{t`Predicts the cycle without devices. Nothing moves.`}</p>}
      {mine && head.state === "failed" && <p className="error">{head.error ?? t`The dry run failed.`}</p>}
      {mine && found?.prediction && (
        <Outcome found={found} prediction={found.prediction} revision={state.history?.revision} />
      )}
    </section>
  );
}

/** Return the chosen branches, and the fields to choose them. */
function useBranches() {
  const state = useEditor((each) => each);
  const { doc, types } = state;
  const [chosen, setChosen] = useState<Record<string, string>>({});
  const found = useMemo(() => (doc?.project?.has_logic ? branchings(doc, types) : []), [doc, types]);
  const branches = existingChoices(found, chosen);
  const fields = found.length > 0 && (
    <details>
      <summary>{t`Branches`}</summary>
      {found.map(({ id, name, branches: options }) => (
        <SelectField
          key={id}
          label={name}
          value={branches[id] ?? ""}
          choices={[
            ["", t`As in the last run`],
            ...options.map(({ to, when }): [string, string] => [to, `${when} → ${nameOf(state, to)}`]),
          ]}
          onChange={(to) => setChosen((before) => ({ ...before, [id]: to }))}
        />
      ))}
    </details>
  );
  return { branches, fields };
}

interface OutcomeProps {
  found: GetDryRunData;
  prediction: Prediction;
  revision: number | undefined;
}

function Outcome({ found, prediction, revision }: OutcomeProps) {
  const { trace, summary, problem, durations, assumptions } = prediction;
  const { dry_run: head, outdated } = found;
  const names = new Map(trace.spans.map((each) => [each.action_id, each.name]));
  const unknown = durations.filter((each) => each.source === "unknown").map((each) => names.get(each.action_id) ?? "");
  const old = outdated || (revision !== undefined && revision !== head.revision);
  const at = problem?.pose?.position;
  return (
    <>
      {old && (
        <p className="tag warn">
          <Icon name="warn" size={14} /> {t`The program was edited since. Start it again.`}
        </p>
      )}
      {problem ? (
        <div className="exception" role="alert">
          <p>
            <Icon name="warn" /> <strong>{t`${problem.name} would fail`}</strong>
          </p>
          <p>{problem.reason}</p>
          {at && <p className="small">{t`At x ${fixed(at.x, 3)}, y ${fixed(at.y, 3)}, z ${fixed(at.z, 3)} m`}</p>}
          <ShowAction id={problem.action_id} />
        </div>
      ) : (
        <p className="all-well">
          <Icon name="check" /> {t`No problems found.`}
        </p>
      )}
      <Facts summary={summary} />
      {unknown.length > 0 && <p className="small">{t`Unknown duration, counted as 0 s: ${unknown.join(", ")}`}</p>}
      <Gantt name={t`Dry run ${head.number}`} trace={trace} summary={summary} span={summary.whole} />
      <details>
        <summary>{t`Assumptions`}</summary>
        <ul className="small">
          {assumptions.map((each) => (
            <li key={`${each.action_id ?? ""}${each.text}`}>{each.text}</li>
          ))}
        </ul>
      </details>
      <Comparison timing={{ key: `dry ${head.number}`, trace, summary }} found={found} />
    </>
  );
}

/** Cycle time, bottleneck and longest waits. */
export function Facts({ summary }: { summary: TraceSummary }) {
  const names = new Map(summary.devices.map((each) => [each.id, each.name]));
  const [bottleneck] = summary.devices;
  return (
    <dl className="facts">
      <dt>{t`Cycle`}</dt>
      <dd>
        <strong>{duration(summary.cycle)}</strong>
      </dd>
      {bottleneck && (
        <>
          <dt>{t`Bottleneck`}</dt>
          <dd>{t`${bottleneck.name}, busy ${decimal(bottleneck.share * 100, 0)} %`}</dd>
        </>
      )}
      {summary.device_waits.length > 0 && (
        <>
          <dt>{t`Waits`}</dt>
          <dd>
            {summary.device_waits.slice(0, WAITS).map((wait) => (
              <div key={wait.device}>
                {t`${names.get(wait.device) ?? ""}: ${duration(wait.duration)} for ${names.get(wait.for_device) ?? ""}`}
              </div>
            ))}
          </dd>
        </>
      )}
    </dl>
  );
}

/** Compare with another dry run or a run: both charts at the same scale, and the actions that differ most. */
function Comparison({ timing, found }: { timing: Timing; found: GetDryRunData }) {
  const project = useEditor((state) => state.doc?.project?.id);
  const runs = useEditor((state) => state.program.runs);
  const [other, setOther] = useState<Timing | null>(null);
  const choices: [string, string][] = [
    ["", t`Nothing`],
    ...found.stored
      .filter((each) => each.number !== found.dry_run.number)
      .map((each): [string, string] => [`dry ${each.number}`, t`Dry run ${each.number}, ${clock(each.started)}`]),
    ...runs
      .filter((each) => each.project_id === project && each.end !== "running" && each.actions > 0)
      .slice(0, RUNS)
      .map((each): [string, string] => [`run ${each.number}`, t`Run ${each.number}, ${clock(each.started)}`]),
  ];
  const choose = (key: string) => {
    setOther(null);
    if (key) loadTiming(key).then(setOther, (error: unknown) => notify("error", sentence(error)));
  };
  if (choices.length === 1) return null;
  return (
    <>
      <SelectField label={t`Compare with`} value={other?.key ?? ""} choices={choices} onChange={choose} />
      {other && (
        <>
          <Gantt
            key={other.key}
            name={choices.find(([key]) => key === other.key)?.[1] ?? ""}
            trace={other.trace}
            summary={other.summary}
            span={timing.summary.whole}
          />
          <Differences before={other.summary} after={timing.summary} />
        </>
      )}
    </>
  );
}

function Differences({ before, after }: { before: TraceSummary; after: TraceSummary }) {
  const old = new Map(before.actions.map((each) => [each.action_id, each.median]));
  const rows = after.actions
    .map((each) => ({ name: each.name, key: each.action_id, first: old.get(each.action_id), second: each.median }))
    .sort((a, b) => Math.abs(b.second - (b.first ?? 0)) - Math.abs(a.second - (a.first ?? 0)))
    .slice(0, DIFFERENCES);
  const signed = (value: number) => `${value < 0 ? "−" : "+"}${fixed(Math.abs(value), 2)} s`;
  return (
    <table className="differences">
      <thead>
        <tr>
          <th>{t`Action`}</th>
          <th>{t`Before`}</th>
          <th>{t`Dry run`}</th>
          <th>{t`Change`}</th>
        </tr>
      </thead>
      <tbody>
        <tr>
          <th>{t`Cycle`}</th>
          <td>{`${fixed(before.cycle, 2)} s`}</td>
          <td>{`${fixed(after.cycle, 2)} s`}</td>
          <td>{signed(after.cycle - before.cycle)}</td>
        </tr>
        {rows.map((row) => (
          <tr key={row.key}>
            <td>{row.name}</td>
            <td>{row.first === undefined ? "–" : `${fixed(row.first, 2)} s`}</td>
            <td>{`${fixed(row.second, 2)} s`}</td>
            <td>{row.first === undefined ? "" : signed(row.second - row.first)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
