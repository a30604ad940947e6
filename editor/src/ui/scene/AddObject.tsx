/** Add a device: required settings first, with a test of the connection. Typed values stay until it is added. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { setByCellFile } from "../../commands/nodes";
import { addObject, freeObjectName } from "../../commands/scene";
import { words } from "../../program/naming";
import { missing, missingForControl, parametersOf } from "../../program/settings";
import type { ObjectTypeMeta } from "../../protocol/types";
import { keepForm, useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";
import { NodePick } from "../nodes/NodePick";
import { RefusedText, useRefusal } from "../points/Refusal";
import { Check } from "./Check";
import { SettingsFields } from "./Settings";
import { TypeUse } from "./TypeUse";

export function AddObject({ type, why, onBack }: { type: ObjectTypeMeta; why: string; onBack: () => void }) {
  const draft = useEditor((state) => state.ui.forms[type.type]);
  const [proposed] = useState(() => freeObjectName(type.type.replace(/([a-z])([A-Z])/g, "$1_$2").toLowerCase()));
  const [tried, setTried] = useState(false);
  const { refused, busy, ask } = useRefusal();
  const values = draft?.values ?? {};
  const name = draft?.name ?? proposed;
  const lacking = missing(type.settings, values);
  const hasNodes = useEditor(({ nodes }) => nodes?.configured === true && nodes.nodes.length > 0);
  const assigned = useEditor((state) => state.nodes?.assigned[name.trim()] ?? "");
  const byCell = useEditor((state) => setByCellFile(state, name.trim()));
  const node = hasNodes ? (draft?.node ?? "") : "";
  const uncontrolled = missingForControl(type.settings, values);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    setTried(true);
    if (why || lacking.length > 0) return;
    void ask(addObject(type, name.trim(), parametersOf(type.settings, values), byCell ? "" : node)).then(
      (done) => done && keepForm(type.type, null),
    );
  };
  return (
    <form className="add-form" onSubmit={submit}>
      <Button variant="plain" onPress={onBack}>
        {t`← All types`}
      </Button>
      <h3>{type.display_name ?? type.type}</h3>
      <p className="quiet small description">{type.description}</p>
      {type.has_pose && <p className="quiet small">{t`The object is added at the view center.`}</p>}
      <SettingsFields
        type={type}
        values={values}
        why=""
        autoFocus
        onChange={(next) => keepForm(type.type, { ...draft, values: next })}
      />
      <Field
        label={t`Name`}
        value={name}
        onChange={(next) => keepForm(type.type, { ...draft, values, name: next })}
        autoComplete="off"
      />
      {hasNodes && (
        <NodePick
          chosen={assigned || node}
          isDisabled={byCell !== ""}
          onChange={(next) => keepForm(type.type, { ...draft, values, node: next })}
        />
      )}
      {hasNodes && byCell && <p className="quiet small">{byCell}</p>}
      {type.settings.length > 0 && <Check type={type} values={values} node={assigned || node} />}
      <Button variant="primary" icon="plus" type="submit" why={why} isDisabled={busy}>
        {busy ? t`Adding…` : t`Add`}
      </Button>
      {/** Below the button, so that the button does not move when a field loses the focus. */}
      {tried && lacking.length > 0 && <RefusedText>{t`Required: ${lacking.map(words).join(", ")}.`}</RefusedText>}
      {lacking.length === 0 && uncontrolled.length > 0 && (
        <p className="small">{t`Not set: ${uncontrolled.map(words).join(", ")}. The device can only be observed.`}</p>
      )}
      <RefusedText>{refused}</RefusedText>
      <TypeUse type={type} onDeleted={onBack} />
    </form>
  );
}
