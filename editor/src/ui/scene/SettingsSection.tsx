/** The settings of the selected object: changed together and saved by one request. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { notBuildable, setParameters } from "../../commands/scene";
import { heldBy } from "../../store/selectors";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { missing, parametersOf, SettingsFields, type Values } from "./Settings";

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]);
  const type = useEditor((state) => state.types.byName[object?.type ?? ""]);
  const holder = useEditor((state) => heldBy(state, id));
  const cannot = useEditor((state) => notBuildable(state, "UpdateObjectParameters"));
  const overlaid = useEditor((state) => state.live.objects[id]?.overlaid);
  const [draft, setDraft] = useState<Values | null>(null);
  const { refused, busy, ask } = useRefusal();
  if (!object || !settings) return null;
  const known: Values = Object.fromEntries(object.parameters.map((each) => [each.name, each.value]));
  const values = draft ?? known;
  const why = holder ? t`In use by ${holder}.` : cannot;
  const lacking = missing(settings, values);
  return (
    <>
      {why && <p className="quiet small">{why}</p>}
      {overlaid && overlaid.length > 0 && (
        <p className="small">{t`Set by the cell file of the server: ${overlaid.join(", ")}.`}</p>
      )}
      <SettingsFields key={id} settings={settings} values={values} why={why} onChange={setDraft} />
      {lacking.length > 0 && <RefusedText>{t`Required: ${lacking.join(", ")}.`}</RefusedText>}
      <RefusedText>{refused}</RefusedText>
      {draft && (
        <div className="actions">
          <Button onPress={() => setDraft(null)}>{t`Revert`}</Button>
          <Button
            look="primary"
            why={why}
            isDisabled={busy || lacking.length > 0}
            onPress={() =>
              void ask(setParameters(id, parametersOf(settings, draft))).then((done) => done && setDraft(null))
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
