/** The trace of the program, newest first: actions with parameters, results and durations. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { Button as AriaButton } from "react-aria-components";
import { clock, duration } from "../../formats";
import { laneIn } from "../../program/lanes";
import { metaOf } from "../../program/logic";
import { words } from "../../program/naming";
import type { ActionHold, HoldChoice, TraceEntry } from "../../protocol/types";
import { anyAction } from "../../store/scope";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { Values } from "../program/Values";
import "../program/program.css";

/** Number of entries shown at first. */
const SHOWN = 30;

export function Trace({ onChoose }: { onChoose: (actionId: string) => void }) {
  const trace = useEditor((state) => state.program.trace);
  const paused = useEditor((state) => state.program.state === "paused");
  const doc = useEditor((state) => state.doc);
  const [all, setAll] = useState(false);
  const [open, setOpen] = useState(0);
  if (trace.length === 0) return null;
  const newest = [...trace].sort((a, b) => b.number - a.number);
  const numbered = new Map(trace.map((each) => [each.number, each]));
  const shown = all ? newest : newest.slice(0, SHOWN);
  return (
    <section className="run-part" aria-label={t`Trace`}>
      <h3>{t`Trace`}</h3>
      <ol className="trace" reversed>
        {shown
          .map((entry) => ({ entry, lane: doc ? laneIn(doc, numbered, entry) : "" }))
          .map(({ entry, lane }) => (
            <li key={entry.number} data-failed={entry.error !== undefined} data-running={entry.duration === undefined}>
              <AriaButton
                className="trace-row"
                aria-expanded={open === entry.number}
                onPress={() => setOpen(open === entry.number ? 0 : entry.number)}
              >
                <span className="trace-name" data-inside={entry.call !== undefined}>
                  {entry.name || t`an action`}
                  {lane && lane !== entry.name && <span className="tag">{lane}</span>}
                </span>
                <span className="quiet small">
                  {entry.error !== undefined
                    ? t`failed`
                    : entry.duration === undefined
                      ? paused
                        ? t`waiting`
                        : t`running`
                      : duration(entry.duration)}
                </span>
              </AriaButton>
              {open === entry.number && <Detail entry={entry} onChoose={onChoose} />}
            </li>
          ))}
      </ol>
      {!all && trace.length > SHOWN && <Button onPress={() => setAll(true)}>{t`Show all ${trace.length}`}</Button>}
    </section>
  );
}

/** Return the duration of a hold of the program at an action, and the user who decided about it. */
function heldWords({ duration: held = 0, choice, by = "" }: ActionHold): string {
  const words: Record<HoldChoice, string> = {
    retry: t`Try again`,
    result: t`Enter the result`,
    skip: t`Done by hand, continue`,
    error_exit: t`error exit`,
    end: t`End the program`,
  };
  return t`Held for ${duration(held)}. ${by}: ${choice ? words[choice] : ""}`;
}

function Detail({ entry, onChoose }: { entry: TraceEntry; onChoose: (actionId: string) => void }) {
  const action = useEditor((state) => state.doc && anyAction(state.doc, entry.action_id));
  const meta = useEditor((state) => (action && state.doc ? metaOf(state.types, state.doc, action) : undefined));
  const names = meta?.parameters.map((each) => words(each.name)) ?? [];
  return (
    <div className="trace-detail">
      {entry.attempt !== undefined && <p className="small">{t`Attempt ${entry.attempt}`}</p>}
      {entry.error !== undefined && <p className="error">{entry.error}</p>}
      {entry.hold?.choice && <p className="small">{heldWords(entry.hold)}</p>}
      {entry.parameters && entry.parameters.length > 0 && <Values names={names} values={entry.parameters} />}
      {entry.results && entry.results.length > 0 && (
        <>
          <p className="small quiet">{t`Results`}</p>
          <Values names={action?.flows[0]?.outputs ?? []} values={entry.results} />
        </>
      )}
      <p className="small quiet">{t`at ${clock(entry.started, true)}`}</p>
      {action && <Button onPress={() => onChoose(entry.action_id)}>{t`Show it`}</Button>}
    </div>
  );
}
