/** A connection: its ends and its condition. It is updated by one request. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { notEditable, removeStep, setCondition, startConnecting } from "../../commands/program";
import { operandsOf } from "../../program/comparisons";
import { branchProblems } from "../../program/completeness";
import { nextSteps, placeOf, START, whenOf } from "../../program/logic";
import type { LogicWhen } from "../../protocol/types";
import { getState, select, useEditor } from "../../store/store";
import { nameOf, selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { Comparisons } from "./Comparisons";
import "./program.css";

const Step: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const [problem, setProblem] = useState("");
  const { doc, types } = state;
  const step = doc?.logic[id];
  if (!doc || !step) return null;
  const from = placeOf(step.start);
  const to = placeOf(step.end);
  const why = notEditable(state, "UpdateLogicItem");
  const operands = from === START ? [] : operandsOf(doc, types, from);
  const alone = nextSteps(doc, from).length === 1;
  const faults = branchProblems(doc, types, from).filter((each) => each.id === id || each.id === from);
  const set = async (when: LogicWhen) => {
    const refused = await setCondition(id, when);
    setProblem(refused);
    return refused;
  };
  return (
    <>
      <div className="row">
        <Button variant="plain" onPress={() => select(selectionOf(getState(), from))}>
          {nameOf(state, from)}
        </Button>
        <span aria-hidden="true">→</span>
        <Button variant="plain" onPress={() => select(selectionOf(getState(), to))}>
          {nameOf(state, to)}
        </Button>
      </div>
      {operands.length > 0 ? (
        <Comparisons
          doc={doc}
          types={types}
          when={whenOf(step)}
          operands={operands}
          from={from}
          none={alone ? t`none: always` : t`none: otherwise`}
          why={why}
          onSet={set}
        />
      ) : (
        <p className="quiet small">
          {from === START
            ? t`First step of the program.`
            : t`${nameOf(state, from)} has no result to branch on, and the project has no variable.`}
        </p>
      )}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      {faults.map((each) => (
        <p key={each.id} className="error small" role="status">
          {each.text}
        </p>
      ))}
      {faults.some((each) => each.id === from) && (
        <Button icon="plus" why={why} onPress={() => startConnecting(from)}>
          {t`Add a step for all other values`}
        </Button>
      )}
      <div className="row">
        <Button why={why} onPress={() => startConnecting(from, undefined, id)}>
          {t`Change target`}
        </Button>
        <Button variant="plain" why={why} onPress={() => void removeStep(id)}>
          {t`Remove`}
        </Button>
      </div>
    </>
  );
};
export default Step;
