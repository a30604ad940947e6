/** All actions in the order of execution, unreachable ones last; with breakpoints. */

import { t } from "@lingui/core/macro";
import { useMemo } from "react";
import { Button as AriaButton, ToggleButton } from "react-aria-components";
import { breakAt } from "../../commands/run";
import { storeViewState } from "../../commands/viewstate";
import { conditionWords, incoming, outgoing, placeOf, START } from "../../program/logic";
import type { Problem } from "../../program/problems";
import { theEngine } from "../../session/engine";
import { whyUnavailable } from "../../store/permissions";
import type { OpenDocument } from "../../store/state";
import { notify, select, setUi, useEditor } from "../../store/store";
import { nameOf, withNames } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { ReachBadge } from "../points/Reach";

export function Steps({ problems }: { problems: Problem[] }) {
  const state = useEditor((each) => each);
  const { doc, types, breakpoints, program } = state;
  const order = useMemo(() => (doc ? ordered(doc) : []), [doc]);
  const cannot = whyUnavailable(state, "SetBreakpoints");
  if (!doc) return null;
  if (order.length === 0) return <p className="quiet">{t`No actions yet. Add one under “Add”.`}</p>;
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
      <ol className="steps">
        {order.map((id) => {
          const action = doc.actions[id];
          if (!action) return null;
          const problem = problems.find((each) => each.id === id);
          const after = incoming(doc, id)
            .map((item) => conditionWords(doc, types, item))
            .filter(Boolean);
          const running = program.running.includes(id) || state.live.executing === id;
          return (
            <li key={id} data-running={running} data-selected={state.ui.selection?.id === id}>
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
                onPress={() => {
                  select({ kind: "action", id });
                  setUi({ tool: "" });
                  theEngine()?.focus(id);
                }}
              >
                <span className="step-head">
                  <span className="step-name">{action.name}</span>
                  <ReachBadge id={id} />
                </span>
                <span className="quiet small">
                  {t`${nameOf(state, action.type.split("/")[0] ?? "")} at ${nameOf(state, action.pointId)}`}
                  {after.length > 0 && ` · ${t`if ${after.join(", ")}`}`}
                </span>
                {running && <span className="tag good">{t`running`}</span>}
                {problem && (
                  <span className={`tag ${problem.level === "error" ? "bad" : "warn"}`}>
                    <Icon name="warn" size={14} /> {withNames(state, problem.text)}
                  </span>
                )}
              </AriaButton>
            </li>
          );
        })}
      </ol>
    </>
  );
}

/** Return the actions breadth-first from START, then unreachable ones. */
export function ordered(doc: OpenDocument): string[] {
  const found: string[] = [];
  const waiting = [START];
  const seen = new Set<string>([START]);
  for (let id = waiting.shift(); id !== undefined; id = waiting.shift()) {
    if (id in doc.actions) found.push(id);
    for (const item of outgoing(doc, id)) {
      const next = placeOf(item.end);
      if (seen.has(next)) continue;
      seen.add(next);
      waiting.push(next);
    }
  }
  return [...found, ...Object.keys(doc.actions).filter((id) => !seen.has(id))];
}
