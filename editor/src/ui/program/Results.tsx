/** Results of an action: their names, and the actions that use them. */

import { t } from "@lingui/core/macro";
import { Fragment, useId, useState } from "react";
import { nameResults, notEditable } from "../../commands/program";
import { calledBy, metaOf, variableNamed } from "../../program/logic";
import { newOutputs, resultNames } from "../../program/naming";
import { usersOf } from "../../program/problems";
import { typeName } from "../../program/values";
import { select, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { ValueField } from "./ValueField";
import "./program.css";

const Results: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const [problem, setProblem] = useState("");
  const { doc, types } = state;
  const action = doc?.actions[id];
  if (!doc || !action) return null;
  const returns = metaOf(types, doc, action)?.returns ?? [];
  const outputs = action.flows[0]?.outputs ?? [];
  const called = calledBy(doc, action);
  const method = called?.name ?? action.type.split("/")[1] ?? action.name;
  const why = notEditable(state);
  if (returns.length === 0) return <p className="quiet small">{t`No results`}</p>;
  if (outputs.length === 0) {
    return (
      <>
        <p className="quiet small">{t`Results are not stored.`}</p>
        <Button
          why={why}
          onPress={() =>
            void nameResults(id, called ? resultNames(doc, called) : newOutputs(doc, method, returns.length)).then(
              setProblem,
            )
          }
        >
          {t`Store results`}
        </Button>
        {problem && (
          <p className="error" role="alert">
            {problem}
          </p>
        )}
      </>
    );
  }
  const users = usersOf(doc, types, { action: id });
  return (
    <>
      {returns.map((type, index) => {
        const output = outputs[index] ?? "";
        const stored = variableNamed(doc, output);
        const rename = (name: string) =>
          nameResults(
            id,
            outputs.map((each, at) => (at === index ? name : each)),
          );
        const own = newOutputs(doc, method, 1)[0] ?? output;
        return (
          <Fragment key={`${id}/${index}`}>
            {!stored && (
              <ValueField
                label={typeName(type)}
                name={t`Name of result ${index + 1}`}
                type="string"
                json={JSON.stringify(output)}
                why={why}
                onSet={(json) => rename(JSON.parse(json) as string)}
              />
            )}
            <StoredIn
              type={type}
              stored={stored?.name ?? ""}
              why={why}
              onSet={(name) => void rename(name || own).then(setProblem)}
            />
          </Fragment>
        );
      })}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      {users.length > 0 && (
        <p className="small">
          {t`Used by`}{" "}
          {users.map((each) => (
            <Button key={each} variant="plain" onPress={() => select({ kind: "action", id: each })}>
              {doc.actions[each]?.name}
            </Button>
          ))}
        </p>
      )}
    </>
  );
};
export default Results;

/** Choice between a name of its own for a result, and the variables of its type. */
function StoredIn(of: { type: string; stored: string; why: string; onSet: (name: string) => void }) {
  const { type, stored, why, onSet } = of;
  const id = useId();
  const parameters = useEditor((state) => state.doc?.parameters);
  const fitting = Object.values(parameters ?? {}).filter((each) => each.variable && each.type === type);
  if (fitting.length === 0) return null;
  return (
    <div className="field">
      <label htmlFor={id}>{t`Store in variable`}</label>
      <select id={id} value={stored} disabled={why !== ""} onChange={(event) => onSet(event.target.value)}>
        <option value="">{t`none: result of this action`}</option>
        {fitting.map((each) => (
          <option key={each.id} value={each.name}>
            {each.name}
          </option>
        ))}
      </select>
    </div>
  );
}
