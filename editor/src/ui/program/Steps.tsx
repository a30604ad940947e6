/**
 * The program as a list in the order of execution, with indented branches, breakpoints and the running action. Only the
 * rows in view are rendered.
 */

import { t } from "@lingui/core/macro";
import { useEffect, useMemo, useRef, useState } from "react";
import { Button as AriaButton, ToggleButton } from "react-aria-components";
import { pickAction, startPicking } from "../../commands/functions";
import { notEditable } from "../../commands/program";
import { breakAt } from "../../commands/run";
import { storeViewState } from "../../commands/viewstate";
import { detailOf } from "../../program/functions";
import { lanesOf } from "../../program/lanes";
import { listingOf, type Row } from "../../program/listing";
import { branchKind, calledBy, conditionWords } from "../../program/logic";
import { movableRuns } from "../../program/moving";
import { isParallel } from "../../program/parallel";
import type { Problem } from "../../program/problems";
import { valuesOf } from "../../program/step";
import { END, placeOf } from "../../program/steps";
import { takenExit } from "../../program/takenExit";
import { theEngine } from "../../session/engine";
import { whyUnavailable } from "../../store/permissions";
import { isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import { getState, notify, select, setUi, useEditor } from "../../store/store";
import { nameOf, selectionOf, withNames } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { ReachBadge } from "../points/Reach";
import { type Drag, MoveHandle } from "./MoveHandle";
import { at, useRows } from "./useRows";

/** Heights of rows, and indentation of a level up to the deepest one shown, in pixels at the usual text size. */
const HEIGHT: Readonly<Record<Row["kind"], number>> = { action: 62, lane: 62, branch: 48, goto: 48, unreached: 40 };
const INDENT = 16;
const DEEPEST = 7;

export function Steps({ problems }: { problems: Problem[] }) {
  const state = useEditor((each) => each);
  const { doc, program, live, ui } = state;
  const [drag, setDrag] = useState<Drag | null>(null);
  const rows = useMemo(() => (doc ? listingOf(doc) : []), [doc?.actions, doc?.logic]);
  const runs = useMemo(
    () => (doc ? movableRuns(doc) : new Map<string, readonly string[]>()),
    [doc?.actions, doc?.logic],
  );
  const faults = useMemo(() => new Map([...problems].reverse().map((each) => [each.id, each])), [problems]);
  const list = useRef<HTMLOListElement>(null);
  const { tops, first, last, show } = useRows(
    list,
    rows.map((row) => HEIGHT[row.kind]),
  );

  const running = program.running.findLast((id) => doc !== null && id in doc.actions) ?? live.executing;
  const active = isRunning(state);
  const followed = useRef(true);
  useEffect(() => {
    followed.current = true;
    // The user scrolls: the list does not move any more before the next run.
    const scrolled = () => (followed.current = false);
    const host = list.current?.closest(".panel-body");
    for (const event of ["wheel", "touchmove"]) host?.addEventListener(event, scrolled, { passive: true });
    return () => {
      for (const event of ["wheel", "touchmove"]) host?.removeEventListener(event, scrolled);
    };
  }, [active]);
  const follows = active && followed.current && running !== "" ? running : (ui.selection?.id ?? "");
  useEffect(() => {
    const index = rows.findIndex((row) => idOf(row) === follows);
    if (index >= 0) show(index);
  }, [follows, rows, show]);

  if (!doc) return null;
  if (rows.length === 0) return <p className="quiet">{t`No actions yet. Add one under “Add”.`}</p>;
  const exit = takenExit(state)?.id;
  return (
    <>
      <label className="check">
        <input
          type="checkbox"
          checked={state.view.user.hide_steps !== true}
          onChange={(event) => storeViewState("user", { hide_steps: event.target.checked ? null : true })}
        />
        <span>{t`Show steps in the 3D view`}</span>
      </label>
      {doc.project?.has_logic && !ui.picked && (
        <Button variant="plain" icon="function" why={notEditable(state, "MakeFunction")} onPress={() => startPicking()}>
          {t`Select several actions`}
        </Button>
      )}
      <ol className="steps" ref={list} style={{ height: at(tops, rows.length) }} aria-label={t`Program`}>
        {rows.slice(first, last).map((row, n) => {
          const index = first + n;
          const id = idOf(row);
          return (
            <li
              key={id + row.kind}
              aria-setsize={rows.length}
              aria-posinset={index + 1}
              data-action={row.kind === "action" || row.kind === "lane" ? id : undefined}
              data-lane={row.kind === "lane" || undefined}
              data-depth={row.depth}
              data-running={program.running.includes(id) || live.executing === id}
              data-selected={ui.selection?.id === id || ui.picked?.includes(id)}
              data-taken={exit === id}
              data-drop={drag && drag.over === id ? drag.side : undefined}
              style={{
                top: at(tops, index),
                height: at(tops, index + 1) - at(tops, index),
                left: Math.min(row.depth, DEEPEST) * INDENT,
              }}
            >
              {row.kind === "action" || row.kind === "lane" ? (
                <ActionRow
                  state={state}
                  id={id}
                  problem={faults.get(id)}
                  run={runs.get(id)}
                  drag={drag}
                  onDrag={setDrag}
                />
              ) : row.kind === "unreached" ? (
                <p className="quiet small">{t`Never run:`}</p>
              ) : (
                <LinkRow state={state} row={row} problem={faults.get(id)} />
              )}
            </li>
          );
        })}
      </ol>
    </>
  );
}

const idOf = (row: Row): string => ("id" in row ? row.id : row.kind === "unreached" ? "" : row.item.id);

interface ActionRowProps {
  state: State;
  id: string;
  problem: Problem | undefined;
  /** The actions among which it can be moved. */
  run: readonly string[] | undefined;
  drag: Drag | null;
  onDrag: (drag: Drag | null) => void;
}

function ActionRow({ state, id, problem, run, drag, onDrag }: ActionRowProps) {
  const { doc, types, breakpoints, program, live, ui } = state;
  const action = doc?.actions[id];
  if (!doc || !action) return null;
  const called = calledBy(doc, action);
  const cannot = whyUnavailable(state, "SetBreakpoints");
  const running = program.running.includes(id) || live.executing === id;
  const inside = running && lanesOf(state).find((each) => each.id === id)?.doing;
  return (
    <>
      <ToggleButton
        className="breakpoint"
        aria-label={t`Pause before ${action.name}`}
        isSelected={id in breakpoints}
        onChange={(on) => (cannot ? notify("info", cannot) : void breakAt(id, on))}
      >
        <span className="breakpoint-dot" aria-hidden="true" />
      </ToggleButton>
      <AriaButton
        className="step"
        data-name
        aria-pressed={ui.picked?.includes(id)}
        onPress={() => (ui.picked ? pickAction(id) : goTo(id))}
      >
        <span className="step-head">
          {called && <Icon name="function" size={16} />}
          {isParallel(action) && <Icon name="parallel" size={16} />}
          <span className="step-name">{action.name}</span>
          <ReachBadge id={id} />
          {running && <span className="tag good">{program.state === "paused" ? t`waiting` : t`running`}</span>}
        </span>
        {problem ? (
          <span className={`small step-more ${problem.level === "error" ? "error" : ""}`} title={problem.text}>
            <Icon name="warn" size={14} /> {withNames(state, problem.text)}
          </span>
        ) : (
          <span className="quiet small step-more">
            {[inside ? t`at ${inside}` : detailOf(doc, action), called && valuesOf(doc, types, action)]
              .filter(Boolean)
              .join(" · ")}
          </span>
        )}
      </AriaButton>
      {run && <MoveHandle id={id} name={action.name} run={run} drag={drag} onDrag={onDrag} />}
    </>
  );
}

/** The head of a branch, or where it continues. */
function LinkRow({
  state,
  row: { kind, item },
  problem,
}: {
  state: State;
  row: Extract<Row, { kind: "branch" | "goto" }>;
  problem: Problem | undefined;
}) {
  const { doc, types } = state;
  if (!doc) return null;
  const to = placeOf(item.end);
  const words = conditionWords(doc, types, item) || t`always`;
  return (
    <AriaButton className="step-branch" data-name onPress={() => goTo(kind === "branch" ? item.id : to)}>
      {kind === "branch" ? (
        <span className={`branch ${branchKind(item)}`}>{words}</span>
      ) : (
        <>
          <span aria-hidden="true">→</span>
          <span className="step-more">{to === END ? t`end of the cycle` : t`continues with ${nameOf(state, to)}`}</span>
        </>
      )}
      {problem && <Icon name="warn" size={14} />}
    </AriaButton>
  );
}

function goTo(id: string): void {
  select(selectionOf(getState(), id));
  setUi({ tool: "" });
  theEngine()?.focus(id);
}
