/** The form of a type's settings, with problems next to the fields. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { addObject, freeObjectName } from "../../commands/scene";
import { words } from "../../program/naming";
import type { ObjectTypeMeta } from "../../protocol/types";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { missing, parametersOf, SettingsFields, type Values } from "./Settings";
import { TypeUse } from "./TypeUse";

export function AddObject({ type, why, onBack }: { type: ObjectTypeMeta; why: string; onBack: () => void }) {
  const [name, setName] = useState(() => freeObjectName(type.type.replace(/([a-z])([A-Z])/g, "$1_$2").toLowerCase()));
  const [values, setValues] = useState<Values>({});
  const [tried, setTried] = useState(false);
  const { refused, busy, ask } = useRefusal();
  const lacking = missing(type.settings, values);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    setTried(true);
    if (why || lacking.length > 0) return;
    void ask(addObject(type, name.trim(), parametersOf(type.settings, values)));
  };
  return (
    <form className="add-form" onSubmit={submit}>
      <Button look="plain" onPress={onBack}>
        {t`← All types`}
      </Button>
      <h3>{type.display_name ?? type.type}</h3>
      <p className="quiet small description">{type.description}</p>
      {type.has_pose && <p className="quiet small">{t`The object is added at the view center.`}</p>}
      <Field label={t`Name`} value={name} onChange={setName} autoComplete="off" />
      <SettingsFields settings={type.settings} values={values} why="" onChange={setValues} />
      <Button look="primary" icon="plus" type="submit" why={why} isDisabled={busy}>
        {busy ? t`Adding…` : t`Add`}
      </Button>
      {/** Below the button, so that the button does not move when a field loses the focus. */}
      {tried && lacking.length > 0 && <RefusedText>{t`Required: ${lacking.map(words).join(", ")}.`}</RefusedText>}
      <RefusedText>{refused}</RefusedText>
      <TypeUse type={type} onDeleted={onBack} />
    </form>
  );
}
