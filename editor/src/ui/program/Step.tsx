/** A connection: its ends and its condition. It is updated by one request. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { notEditable, removeStep, setCondition, startConnecting } from "../../commands/program";
import { conditionsOf, linkTo, nextSteps, placeOf, resultAt, START } from "../../program/logic";
import { now, select, useEditor } from "../../store/store";
import { nameOf, selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { ValueField } from "./ValueField";
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
  const results = from === START ? [] : conditionsOf(doc, types, from);
  const result = step.condition && resultAt(doc, types, step.condition.what);
  const alone = nextSteps(doc, from).length === 1;
  const choose = async (what: string) => {
    const chosen = results.find((each) => linkTo(each) === what);
    setProblem(
      await setCondition(
        id,
        chosen && { what, value: chosen.type === "boolean" ? "true" : chosen.type === "string_enum" ? '"value"' : "0" },
      ),
    );
  };
  return (
    <>
      <div className="row">
        <Button look="plain" onPress={() => select(selectionOf(now(), from))}>
          {nameOf(state, from)}
        </Button>
        <span aria-hidden="true">→</span>
        <Button look="plain" onPress={() => select(selectionOf(now(), to))}>
          {nameOf(state, to)}
        </Button>
      </div>
      {results.length > 0 ? (
        <div className="field">
          <label htmlFor="depends-on">{t`Condition`}</label>
          <select
            id="depends-on"
            value={step.condition?.what ?? ""}
            disabled={why !== ""}
            onChange={(event) => void choose(event.target.value)}
          >
            <option value="">{alone ? t`none: always` : t`none: otherwise`}</option>
            {results.map((each) => (
              <option key={linkTo(each)} value={linkTo(each)}>
                {each.action.id === from ? each.name : t`${each.name} of ${each.action.name}`}
              </option>
            ))}
          </select>
        </div>
      ) : (
        <p className="quiet small">
          {from === START
            ? t`First step of the program.`
            : t`${nameOf(state, from)} has no result to branch on (yes or no, whole number, choice).`}
        </p>
      )}
      {step.condition && result && (
        <ValueField
          label={t`Value of ${result.name}`}
          name={result.name}
          type={result.type === "integer_enum" ? "integer" : result.type}
          json={step.condition.value}
          why={why}
          onSet={(value) => setCondition(id, { what: step.condition?.what ?? "", value })}
        />
      )}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="row">
        <Button why={why} onPress={() => startConnecting(from, undefined, id)}>
          {t`Change target`}
        </Button>
        <Button look="plain" why={why} onPress={() => void removeStep(id)}>
          {t`Remove`}
        </Button>
      </div>
    </>
  );
};
export default Step;
