/** The person who is logged on changes their PIN. A separate chunk. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { refusal } from "../../commands/requests";
import { call } from "../../session/connection";
import { notify } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

export default function ChangePin({ onClose }: { onClose: () => void }) {
  const [pin, setPin] = useState("");
  const [wanted, setWanted] = useState("");
  const [again, setAgain] = useState("");
  const { refused, busy, ask } = useRefusal();
  const different = again !== "" && again !== wanted;
  const submit = async (event: FormEvent) => {
    event.preventDefault();
    if (!(await ask(refusal(() => call("ChangeOwnPin", { pin, new_pin: wanted }))))) return;
    notify("info", t`Your PIN was changed.`);
    onClose();
  };
  const secret = { type: "password", inputMode: "numeric", autoComplete: "off", maxLength: 12 } as const;
  return (
    <ModalDialog title={t`Change PIN`} onClose={onClose}>
      <form className="ask-name" onSubmit={(event) => void submit(event)}>
        <Field label={t`Present PIN`} value={pin} onChange={setPin} autoFocus {...secret} />
        <Field label={t`New PIN, 4 to 12 digits`} value={wanted} onChange={setWanted} {...secret} />
        <Field
          label={t`New PIN again`}
          value={again}
          onChange={setAgain}
          isInvalid={different}
          hint={different ? t`The new PINs differ.` : ""}
          {...secret}
        />
        <RefusedText>{refused}</RefusedText>
        <div className="actions">
          <Button onPress={onClose}>{t`Cancel`}</Button>
          <Button variant="primary" type="submit" isDisabled={busy || !pin || !wanted || again !== wanted}>
            {t`Change`}
          </Button>
        </div>
      </form>
    </ModalDialog>
  );
}
