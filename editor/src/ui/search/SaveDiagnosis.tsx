/** A button that saves the diagnosis file. */

import { t } from "@lingui/core/macro";
import { saveDiagnosis } from "../../commands/diagnosis";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

export function SaveDiagnosis() {
  // It needs the role that edits scenes, since it contains addresses and settings of devices.
  const why = useEditor((state) => whyUnavailable(state, "SaveScene"));
  const { refused, busy, ask } = useRefusal();
  return (
    <section className="diagnosis" aria-label={t`Diagnosis`}>
      <h3>{t`Something went wrong?`}</h3>
      <p className="quiet small">
        {t`Saves the open document, devices, versions and the end of the log in a file, without secrets.`}
      </p>
      <Button icon="save" why={why} isDisabled={busy} onPress={() => void ask(saveDiagnosis())}>
        {busy ? t`Collecting…` : t`Save diagnosis file`}
      </Button>
      <RefusedText>{refused}</RefusedText>
    </section>
  );
}
