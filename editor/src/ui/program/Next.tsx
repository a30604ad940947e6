/** The next steps of an action, and buttons to connect further ones. */

import { plural, t } from "@lingui/core/macro";
import { finishConnecting, notEditable, removeStep, startConnecting } from "../../commands/program";
import { freeKinds } from "../../program/errorExits";
import { ordered } from "../../program/listing";
import {
  branchKind,
  cannotLead,
  conditionsOf,
  conditionWords,
  END,
  hasComparisons,
  isConditional,
  linkTo,
  nextSteps,
  outgoing,
  placeOf,
  resultAt,
  START,
} from "../../program/logic";
import { runsOf } from "../../program/runs";
import type { ProjectLogicIf } from "../../protocol/types";
import { select, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { fold } from "../flow/folding";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import "./program.css";

const Next: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const { doc, types } = state;
  const { connecting } = state.ui;
  if (!doc) return null;
  const steps = nextSteps(doc, id);
  const all = outgoing(doc, id);
  const why = notEditable(state, "AddLogicItem");
  if (connecting?.from === id) return <Targets from={id} />;
  const own = conditionsOf(doc, types, id)[0];
  const asked = steps.find((each) => each.condition)?.condition;
  const result = asked ? resultAt(doc, types, asked.what) : own?.action.id === id ? own : undefined;
  const run =
    state.ui.mode === "flow" || state.ui.mode === "split" ? runsOf(doc).find((each) => each.includes(id)) : undefined;
  const free = (value: string) => !steps.some((each) => each.condition?.value === value);
  const on = (value: string): ProjectLogicIf => ({
    what: asked?.what ?? linkTo(result as NonNullable<typeof result>),
    value,
  });
  return (
    <>
      {all.length === 0 && <p className="quiet small">{t`None`}</p>}
      <ul className="next-steps">
        {all.map((step) => (
          <li key={step.id}>
            <Button variant="plain" className="next-step" onPress={() => select({ kind: "logic", id: step.id })}>
              {conditionWords(doc, types, step) && (
                <span className={`branch ${branchKind(step)}`}>{conditionWords(doc, types, step)}</span>
              )}
              <span aria-hidden="true">→</span> {nameOf(state, placeOf(step.end))}
            </Button>
            <Button
              variant="plain"
              icon="close"
              aria-label={t`Remove the connection to ${nameOf(state, placeOf(step.end))}`}
              why={why}
              onPress={() => void removeStep(step.id)}
            />
          </li>
        ))}
      </ul>
      <div className="row">
        {(steps.length === 0 || steps.some(hasComparisons) || (result && result.type !== "boolean")) && (
          <Button icon="plus" why={why} onPress={() => startConnecting(id)}>
            {t`Connect`}
          </Button>
        )}
        {result?.type === "boolean" && steps.every((each) => each.condition) && (
          <>
            {free("true") && (
              <Button why={why} onPress={() => startConnecting(id, on("true"))}>
                <span className="branch true">{t`yes`}</span> {t`If ${result.name}`}
              </Button>
            )}
            {free("false") && (
              <Button why={why} onPress={() => startConnecting(id, on("false"))}>
                <span className="branch false">{t`no`}</span> {t`If not`}
              </Button>
            )}
          </>
        )}
        {result?.type === "boolean" && steps.length === 1 && steps[0] && !isConditional(steps[0]) && (
          <Button icon="plus" why={why} onPress={() => startConnecting(id)}>
            {t`Branch`}
          </Button>
        )}
        {id !== START && freeKinds(doc, id).length > 0 && (
          <Button why={why} onPress={() => startConnecting(id, undefined, undefined, true)}>
            <span className="branch error">{t`on error`}</span> {t`Connect`}
          </Button>
        )}
      </div>
      {run && (
        <Button
          variant="plain"
          icon="list"
          onPress={() => {
            fold(run);
            select(null); // a sequence with the selected action stays unfolded
          }}
        >
          {plural(run.length, { one: "Fold # action in the graph", other: "Fold # actions in the graph" })}
        </Button>
      )}
    </>
  );
};
export default Next;

/** List of possible next steps, for users who do not tap in the view. */
function Targets({ from }: { from: string }) {
  const state = useEditor((each) => each);
  const { doc } = state;
  if (!doc) return null;
  const { item, error } = state.ui.connecting ?? {};
  const targets = [...ordered(doc), END].filter((id) => cannotLead(doc, from, id, item, error || undefined) === "");
  return (
    <>
      <p className="small">
        {error
          ? t`Tap the step that follows if ${nameOf(state, from)} fails, in the view or here. Press Escape to cancel.`
          : t`Tap the step that follows ${nameOf(state, from)}, in the view or here. Press Escape to cancel.`}
      </p>
      <ul className="next-steps targets" aria-label={t`Possible next steps`}>
        {targets.map((id) => (
          <li key={id}>
            <Button variant="plain" className="next-step" onPress={() => void finishConnecting(id)}>
              <Icon name={id === END ? "check" : "action"} size={16} /> {nameOf(state, id)}
            </Button>
          </li>
        ))}
      </ul>
    </>
  );
}
