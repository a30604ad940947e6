/** The settings of the selected object: changed together and saved by one request. */

import { t } from "@lingui/core/macro";
import { notBuildable, setParameters } from "../../commands/scene";
import { words } from "../../program/naming";
import { missing, missingForControl, parametersOf, valuesOf } from "../../program/settings";
import { heldBy } from "../../store/selectors";
import { keepForm, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { Check } from "./Check";
import { SettingsFields } from "./Settings";

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]);
  const type = useEditor((state) => state.types.byName[object?.type ?? ""]);
  const holder = useEditor((state) => heldBy(state, id));
  const cannot = useEditor((state) => notBuildable(state, "UpdateSceneObjectSettings"));
  const overlaid = useEditor((state) => state.live.objects[id]?.overlaid);
  const draft = useEditor((state) => state.ui.forms[id]?.values);
  const { refused, busy, ask } = useRefusal();
  if (!object || !type) return null;
  const { settings } = type;
  const values = draft ?? valuesOf(object.parameters);
  const why = holder ? t`In use by ${holder}.` : cannot;
  const lacking = missing(settings, values);
  const uncontrolled = missingForControl(settings, values).filter((each) => !overlaid?.includes(each));
  return (
    <>
      {why && <p className="quiet small">{why}</p>}
      {overlaid && overlaid.length > 0 && (
        <p className="small">{t`Set by the cell file of the server: ${overlaid.map(words).join(", ")}.`}</p>
      )}
      <SettingsFields
        key={id}
        type={type}
        values={values}
        why={why}
        onChange={(next) => keepForm(id, { values: next })}
      />
      {lacking.length > 0 && <RefusedText>{t`Required: ${lacking.map(words).join(", ")}.`}</RefusedText>}
      {uncontrolled.length > 0 && (
        <p className="small">{t`Not set: ${uncontrolled.map(words).join(", ")}. The device can only be observed.`}</p>
      )}
      <RefusedText>{refused}</RefusedText>
      <Check type={type} values={values} id={id} />
      {draft && (
        <div className="actions">
          <Button onPress={() => keepForm(id, null)}>{t`Revert`}</Button>
          <Button
            variant="primary"
            why={why}
            isDisabled={busy || lacking.length > 0}
            onPress={() =>
              void ask(setParameters(id, parametersOf(settings, draft))).then((done) => done && keepForm(id, null))
            }
          >
            {t`Save settings`}
          </Button>
        </div>
      )}
    </>
  );
};

export default Body;
