/** Choose two to four functions that run at once. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { addParallel, parallelName } from "../../commands/parallel";
import { byName } from "../../formats";
import type { Slot } from "../../program/chain";
import { devicesOf, MAX_BRANCHES, MIN_BRANCHES, whyNotAtOnce } from "../../program/lanes";
import { CALL } from "../../program/operands";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";

export default function ParallelDialog({ slot, onClose }: { slot: Slot | null; onClose: () => void }) {
  const doc = useEditor((state) => state.doc);
  const [name, setName] = useState(parallelName);
  const [chosen, setChosen] = useState<readonly string[]>([]);
  if (!doc) return null;
  const called = chosen.flatMap((id) => doc.functions[id] ?? []);
  const clash = whyNotAtOnce(
    doc,
    called.map((each) => ({ name: each.name, type: `${each.id}/${CALL}` })),
  );
  const fits = called.length >= MIN_BRANCHES && called.length <= MAX_BRANCHES;
  const submit = () => {
    void addParallel(name.trim(), chosen, slot);
    onClose();
  };
  return (
    <ModalDialog title={t`Run in parallel`} onClose={onClose}>
      <p>{t`Select two to four functions. The program continues when all of them have ended.`}</p>
      <fieldset className="parallel-choices">
        <legend className="hidden-but-read">{t`Functions`}</legend>
        {Object.values(doc.functions)
          .sort(byName)
          .map((each) => (
            <label key={each.id} className="check">
              <input
                type="checkbox"
                checked={chosen.includes(each.id)}
                onChange={(event) =>
                  setChosen(event.target.checked ? [...chosen, each.id] : chosen.filter((id) => id !== each.id))
                }
              />
              <span>
                {each.name} <span className="quiet small">{devicesOf(doc, each)}</span>
              </span>
            </label>
          ))}
      </fieldset>
      <Field label={t`Name`} value={name} onChange={setName} autoComplete="off" />
      {clash && (
        <p className="error" role="alert">
          {clash}
        </p>
      )}
      <div className="actions">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" isDisabled={!fits || clash !== "" || name.trim() === ""} onPress={submit}>
          {t`Run in parallel`}
        </Button>
      </div>
    </ModalDialog>
  );
}
