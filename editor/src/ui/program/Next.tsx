/** The next steps of an action, and buttons to connect further ones. */

import { plural, t } from "@lingui/core/macro";
import { beginStep, endStep, notEditable, removeStep } from "../../commands/program";
import {
  cannotLead,
  conditionsOf,
  conditionWords,
  END,
  linkTo,
  outgoing,
  placeOf,
  resultAt,
} from "../../program/logic";
import { runsOf } from "../../program/runs";
import type { ProjectLogicIf } from "../../protocol/types";
import { select, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { fold } from "../flow/folding";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { ordered } from "./Steps";
import "./program.css";

const Next: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const { doc, types } = state;
  const { connecting } = state.ui;
  if (!doc) return null;
  const ways = outgoing(doc, id);
  const why = notEditable(state, "AddLogicItem");
  if (connecting?.from === id) return <Targets from={id} />;
  const own = conditionsOf(doc, types, id)[0];
  const asked = ways.find((each) => each.condition)?.condition;
  const result = asked ? resultAt(doc, types, asked.what) : own?.action.id === id ? own : undefined;
  const run =
    state.ui.mode === "flow" || state.ui.mode === "split" ? runsOf(doc).find((each) => each.includes(id)) : undefined;
  const free = (value: string) => !ways.some((each) => each.condition?.value === value);
  const on = (value: string): ProjectLogicIf => ({
    what: asked?.what ?? linkTo(result as NonNullable<typeof result>),
    value,
  });
  return (
    <>
      {ways.length === 0 && <p className="quiet small">{t`None`}</p>}
      <ul className="ways">
        {ways.map((way) => (
          <li key={way.id}>
            <Button look="plain" className="way" onPress={() => select({ kind: "logic", id: way.id })}>
              {conditionWords(doc, types, way) && (
                <span className={`branch ${branchOf(way.condition)}`}>{conditionWords(doc, types, way)}</span>
              )}
              <span aria-hidden="true">→</span> {nameOf(state, placeOf(way.end))}
            </Button>
            <Button
              look="plain"
              icon="close"
              aria-label={t`Remove the connection to ${nameOf(state, placeOf(way.end))}`}
              why={why}
              onPress={() => void removeStep(way.id)}
            />
          </li>
        ))}
      </ul>
      <div className="row">
        {(ways.length === 0 || (result && result.type !== "boolean")) && (
          <Button icon="plus" why={why} onPress={() => beginStep(id)}>
            {t`Connect`}
          </Button>
        )}
        {result?.type === "boolean" && ways.every((each) => each.condition) && (
          <>
            {free("true") && (
              <Button why={why} onPress={() => beginStep(id, on("true"))}>
                <span className="branch true">{t`yes`}</span> {t`If ${result.name}`}
              </Button>
            )}
            {free("false") && (
              <Button why={why} onPress={() => beginStep(id, on("false"))}>
                <span className="branch false">{t`no`}</span> {t`If not`}
              </Button>
            )}
          </>
        )}
        {result?.type === "boolean" && ways.length === 1 && !ways[0]?.condition && (
          <Button icon="plus" why={why} onPress={() => beginStep(id)}>
            {t`Branch`}
          </Button>
        )}
      </div>
      {run && (
        <Button
          look="plain"
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

export const branchOf = (condition: ProjectLogicIf | undefined): string =>
  !condition ? "always" : condition.value === "true" || condition.value === "false" ? condition.value : "value";

/** List of possible next steps, for users who do not tap in the view. */
function Targets({ from }: { from: string }) {
  const state = useEditor((each) => each);
  const { doc } = state;
  if (!doc) return null;
  const { item } = state.ui.connecting ?? {};
  const targets = [...ordered(doc), END].filter((id) => cannotLead(doc, from, id, item) === "");
  return (
    <>
      <p className="small">
        {t`Tap the step that follows ${nameOf(state, from)}, in the view or here. Press Escape to cancel.`}
      </p>
      <ul className="ways targets" aria-label={t`Possible next steps`}>
        {targets.map((id) => (
          <li key={id}>
            <Button look="plain" className="way" onPress={() => void endStep(id)}>
              <Icon name={id === END ? "check" : "action"} size={16} /> {nameOf(state, id)}
            </Button>
          </li>
        ))}
      </ul>
    </>
  );
}
