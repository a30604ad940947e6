/** One press: a file for whoever helps. */

import { t } from "@lingui/core/macro";
import { saveDiagnosis } from "../../commands/diagnosis";
import { barred } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText, useAsking } from "../points/Doing";

export function SaveDiagnosis() {
  // The role of who changes scenes: addresses and settings of devices are in it.
  const why = useEditor((state) => barred(state, "SaveScene"));
  const { refused, busy, ask } = useAsking();
  return (
    <section aria-label={t`Diagnosis`}>
      <h3>{t`Something went wrong?`}</h3>
      <p className="quiet small">
        {t`A file with the open document, devices, versions and the end of the log, without secrets. It is saved on this computer only.`}
      </p>
      <Button icon="save" why={why} isDisabled={busy} onPress={() => void ask(saveDiagnosis())}>
        {busy ? t`Collecting…` : t`Save diagnosis file`}
      </Button>
      <RefusedText>{refused}</RefusedText>
    </section>
  );
}
