/** Variables: project parameters with their users, and device settings overridden by the project. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { Button as AriaButton } from "react-aria-components";
import { addParameter, override, removeParameter, updateParameter } from "../../commands/parameters";
import { notEditable } from "../../commands/program";
import { byName } from "../../formats";
import { words } from "../../program/naming";
import { usersOf } from "../../program/problems";
import { lastRun } from "../../program/results";
import { extraOf, OWN_PARAMETERS, parseValue, SIMPLE, type Simple, textOf, typeName } from "../../program/values";
import type { ParameterMeta } from "../../protocol/types";
import { isRunning } from "../../store/selectors";
import { select, useEditor } from "../../store/store";
import { nameOf, selectionOf } from "../../viewmodel/names";
import { Field } from "../kit/Field";
import { SwitchField } from "../kit/fields";
import { Button } from "../kit/kit";
import { ValueField } from "./ValueField";

export function Parameters() {
  const parameters = useEditor((state) => state.doc?.parameters);
  return (
    <>
      <p className="quiet small">{t`Variables are shared by all actions of the project.`}</p>
      {Object.values(parameters ?? {})
        .filter((each) => !OWN_PARAMETERS.has(each.name))
        .sort(byName)
        .map((each) => (
          <Variable key={each.id} id={each.id} />
        ))}
      <NewParameter />
      <Overrides />
    </>
  );
}

function Variable({ id }: { id: string }) {
  const state = useEditor((each) => each);
  const { doc, types } = state;
  const parameter = doc?.parameters[id];
  if (!doc || !parameter) return null;
  const why = notEditable(state, "UpdateProjectParameter");
  const users = usersOf(doc, types, { parameter: id });
  const { range } = parameter;
  const cannotRemove =
    notEditable(state, "RemoveProjectParameter") ||
    (users.length > 0 ? t`Used by ${users.map((each) => nameOf(state, each)).join(", ")}.` : "");
  return (
    <section className="constant" aria-label={parameter.name}>
      <ValueField
        label={parameter.display_name || parameter.name}
        name={parameter.name}
        type={parameter.type}
        json={parameter.value}
        extra={range && { minimum: range.min, maximum: range.max }}
        hint={parameter.description || (parameter.variable ? startWords(parameter.type) : typeName(parameter.type))}
        why={why}
        onSet={(value) => updateParameter(id, { value })}
      >
        <Button
          variant="plain"
          icon="close"
          aria-label={t`Remove ${parameter.name}`}
          why={cannotRemove}
          onPress={() => void removeParameter(id)}
        />
      </ValueField>
      <Present id={id} />
      <p className="small used">
        {users.length === 0 ? <span className="quiet">{t`not used`}</span> : `${t`Used by`} `}
        {users.map((each) => (
          <AriaButton key={each} className="chip" onPress={() => select(selectionOf(state, each))}>
            {nameOf(state, each)}
          </AriaButton>
        ))}
      </p>
    </section>
  );
}

const startWords = (type: string): string => t`${typeName(type)} at the start of a run; actions change it`;

/** The present value of a variable while the program runs, and its last one afterwards. */
function Present({ id }: { id: string }) {
  const known = useEditor((state) => {
    const run = lastRun(state, state.doc?.project?.id);
    return run?.statistics?.variables?.find((each) => each.id === id)?.value;
  });
  const running = useEditor(isRunning);
  const type = useEditor((state) => state.doc?.parameters[id]?.type ?? "string");
  if (known === undefined) return null;
  const value = textOf(type, known) || '""';
  return (
    <p className="small" data-variable={id}>
      {running ? t`Now: ${value}` : t`After the last run: ${value}`}
    </p>
  );
}

function NewParameter() {
  const why = useEditor((state) => notEditable(state, "AddProjectParameter"));
  const [open, setOpen] = useState(false);
  const [name, setName] = useState("");
  const [type, setType] = useState<Simple>("integer");
  const [text, setText] = useState("");
  const [variable, setVariable] = useState(false);
  const [problem, setProblem] = useState("");
  if (!open) {
    return (
      <Button icon="plus" why={why} onPress={() => setOpen(true)}>
        {t`New variable`}
      </Button>
    );
  }
  const submit = async (event: FormEvent) => {
    event.preventDefault();
    const value = parseValue(type, text);
    if ("problem" in value) return setProblem(value.problem);
    const refused = await addParameter(name.trim(), type, value.json, variable);
    setProblem(refused);
    if (refused) return;
    setOpen(false);
    setName("");
    setText("");
  };
  return (
    <form className="constant" onSubmit={(event) => void submit(event)}>
      <Field label={t`Name`} value={name} onChange={setName} autoFocus autoComplete="off" />
      <div className="chips" role="radiogroup" aria-label={t`Type`}>
        {SIMPLE.map((each) => (
          <label key={each} className="chip" data-selected={type === each}>
            <input
              type="radio"
              className="hidden-but-read"
              name="kind-of-value"
              checked={type === each}
              onChange={() => setType(each)}
            />
            {typeName(each)}
          </label>
        ))}
      </div>
      <Field
        label={type === "boolean" ? t`Value (yes or no)` : t`Value`}
        value={text}
        onChange={setText}
        autoComplete="off"
      />
      <SwitchField isSelected={variable} onChange={setVariable}>{t`Set by actions`}</SwitchField>
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="actions">
        <Button onPress={() => setOpen(false)}>{t`Cancel`}</Button>
        <Button variant="primary" type="submit" isDisabled={name.trim() === ""}>
          {t`Add`}
        </Button>
      </div>
    </form>
  );
}

function Overrides() {
  const state = useEditor((each) => each);
  const [shown, setShown] = useState("");
  const { doc, types } = state;
  if (!doc) return null;
  const objects = Object.values(doc.objects).filter((each) => (types.byName[each.type]?.settings.length ?? 0) > 0);
  const object = doc.objects[shown];
  return (
    <section className="offers" aria-label={t`Device settings`}>
      <h3>{t`Device settings for this project`}</h3>
      <div className="field">
        <label htmlFor="override-of">{t`Device`}</label>
        <select id="override-of" value={shown} onChange={(event) => setShown(event.target.value)}>
          <option value="">{t`choose…`}</option>
          {objects.map((each) => {
            const count = Object.keys(doc.overrides[each.id] ?? {}).length;
            return (
              <option key={each.id} value={each.id}>
                {each.name}
                {count > 0 ? ` ${t`(${count} changed)`}` : ""}
              </option>
            );
          })}
        </select>
      </div>
      {object &&
        types.byName[object.type]?.settings.map((setting) => (
          <Override key={setting.name} objectId={object.id} setting={setting} />
        ))}
    </section>
  );
}

function Override({ objectId, setting }: { objectId: string; setting: ParameterMeta }) {
  const state = useEditor((each) => each);
  const object = state.doc?.objects[objectId];
  if (!object) return null;
  const { name, type } = setting;
  const replaced = state.doc?.overrides[objectId]?.[name]?.value;
  const given = object.parameters.find((each) => each.name === name)?.value ?? setting.default_value;
  const why = notEditable(state, "AddOverride") || (state.live.state === "stopped" ? "" : t`Go offline first.`);
  return (
    <ValueField
      label={words(name)}
      name={name}
      type={type}
      json={replaced ?? given}
      extra={extraOf(setting)}
      why={why}
      hint={replaced === undefined ? setting.description : t`In the scene: ${textOf(type, given) || t`none`}`}
      onSet={(value) => override(objectId, { name, type }, value)}
    >
      {replaced !== undefined && (
        <Button
          variant="plain"
          icon="undo"
          aria-label={t`Reset ${words(name)} to the scene`}
          why={why}
          onPress={() => void override(objectId, { name, type }, undefined)}
        />
      )}
    </ValueField>
  );
}
