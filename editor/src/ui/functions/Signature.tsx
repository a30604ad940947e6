/** Parameters of the open function, shown at its start, and its results, shown at its end. */

import { t } from "@lingui/core/macro";
import { useId, useMemo, useState } from "react";
import { Button as AriaButton } from "react-aria-components";
import {
  addFunctionParameter,
  addFunctionResult,
  freeParameterName,
  removeFunctionParameter,
  removeFunctionResult,
  updateFunctionParameter,
} from "../../commands/functions";
import { notEditable, setParameter } from "../../commands/program";
import { type EnumerationUse, enumerationsOf } from "../../program/enumerations";
import { callsOf, freeResults, resultOf, usersOfParameter } from "../../program/functions";
import { PASSED_ON } from "../../program/logic";
import { END, START } from "../../program/steps";
import { SIMPLE, typeName } from "../../program/values";
import type { ActionParameter } from "../../protocol/types";
import { scopeOf } from "../../store/scope";
import type { OpenDocument, OpenFunction } from "../../store/state";
import { select, useEditor } from "../../store/store";
import { SelectField } from "../kit/fields";
import { Button } from "../kit/kit";
import { ValueField } from "../program/ValueField";
import type { Section } from "../workplace/section";
import "../program/program.css";
import "./functions.css";

/** Types that a user can choose, in addition to the enumerations that actions of the function take. */
const TYPES = [...SIMPLE, "pose", "position", "joints"] as const;

const Signature: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const why = useEditor((state) => notEditable(state, "AddFunctionParameter"));
  const open = doc?.functions[scopeOf(doc)];
  if (!doc || !open) return null;
  if (id === END) return <FunctionResults doc={doc} open={open} why={why} />;
  return id === START ? <FunctionParameters open={open} why={why} /> : null;
};
export default Signature;

function FunctionParameters({ open, why }: { open: OpenFunction; why: string }) {
  const [problem, setProblem] = useState("");
  return (
    <>
      <p className="quiet small">{t`Each call states the values. Actions use them by the source “Parameter”.`}</p>
      {open.parameters.map((each) => (
        <Parameter key={each.name} open={open} parameter={each} why={why} />
      ))}
      <Button
        icon="plus"
        why={why}
        onPress={() => void addFunctionParameter(freeParameterName("value"), "double").then(setProblem)}
      >
        {t`Add a parameter`}
      </Button>
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}

/** Set the type of a parameter to the enumeration of an action, and use it there. Return why it was refused. */
const passOn = async (name: string, { action, parameter, type, json }: EnumerationUse): Promise<string> =>
  (await updateFunctionParameter(name, { type }, json)) ||
  setParameter(action, { name: parameter, type: PASSED_ON, value: JSON.stringify(name) });

function Parameter({ open, parameter, why }: { open: OpenFunction; parameter: ActionParameter; why: string }) {
  const { name, type } = parameter;
  const [problem, setProblem] = useState("");
  const users = usersOfParameter(open, name);
  const used = users.length > 0 ? t`Used by ${users.map((each) => each.name).join(", ")}.` : "";
  const doc = useEditor((state) => state.doc);
  const known = useEditor((state) => state.types);
  const taken = useMemo(() => (doc ? enumerationsOf(doc, known) : []), [doc, known]);
  const types = [...new Set([type, ...TYPES])];
  return (
    <section className="signature" aria-label={name}>
      <ValueField
        label={t`Name`}
        name={t`Name of ${name}`}
        type="string"
        json={JSON.stringify(name)}
        why={why}
        onSet={(json) => updateFunctionParameter(name, { new_name: JSON.parse(json) as string })}
      >
        <Button
          variant="plain"
          icon="close"
          aria-label={t`Remove ${name}`}
          why={why || used}
          onPress={() => void removeFunctionParameter(name)}
        />
      </ValueField>
      <SelectField
        label={t`Type`}
        value={type}
        choices={[
          ...types.map((each): [string, string] => [each, typeName(each)]),
          ...taken.map(({ label }, n): [string, string] => [`${n}`, t`choice: ${label}`]),
        ]}
        isDisabled={why !== "" || used !== ""}
        onChange={(wanted) => {
          const enumeration = taken[Number(wanted)];
          void (enumeration ? passOn(name, enumeration) : updateFunctionParameter(name, { type: wanted })).then(
            setProblem,
          );
        }}
      />
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <p className="small used">
        {users.length === 0 ? <span className="quiet">{t`not used`}</span> : `${t`Used by`} `}
        {users.map((each) => (
          <AriaButton key={each.id} className="chip" onPress={() => select({ kind: "action", id: each.id })}>
            {each.name}
          </AriaButton>
        ))}
      </p>
    </section>
  );
}

function FunctionResults({ doc, open, why }: { doc: OpenDocument; open: OpenFunction; why: string }) {
  const id = useId();
  const free = freeResults(doc, open);
  const calls = callsOf(doc, open.id).map((each) => each.action.name);
  return (
    <>
      <p className="quiet small">
        {calls.length > 0 ? t`Called by ${calls.join(", ")}.` : t`No action calls this function.`}
      </p>
      <ul className="next-steps">
        {open.returns.map(({ link, type }, index) => {
          const result = resultOf(open, link);
          return (
            <li key={link}>
              <Button
                variant="plain"
                className="next-step"
                onPress={() => select({ kind: "action", id: link.split("/")[0] ?? "" })}
              >
                {result ? t`${result.name} of ${result.action}` : "?"}{" "}
                <span className="quiet small">{typeName(type)}</span>
              </Button>
              <Button
                variant="plain"
                icon="close"
                aria-label={t`Remove ${result?.name ?? ""}`}
                why={why}
                onPress={() => void removeFunctionResult(index)}
              />
            </li>
          );
        })}
      </ul>
      {free.length > 0 ? (
        <div className="field">
          <label htmlFor={id}>{t`Add a result`}</label>
          <select
            id={id}
            value=""
            disabled={why !== ""}
            onChange={(event) => void addFunctionResult(event.target.value)}
          >
            <option value="">{t`choose…`}</option>
            {free.map((each) => (
              <option key={each.link} value={each.link}>
                {t`${each.name} of ${each.action}`}
              </option>
            ))}
          </select>
        </div>
      ) : (
        open.returns.length === 0 && (
          <p className="quiet small">{t`A function returns stored results of actions that run in every case.`}</p>
        )
      )}
    </>
  );
}
