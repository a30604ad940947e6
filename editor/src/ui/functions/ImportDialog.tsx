/** Choose the action points that an imported function uses, if the project has none with their names. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { type FunctionFile, importFunction } from "../../commands/functions";
import { byName } from "../../formats";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { SelectField } from "../kit/fields";
import { Button } from "../kit/kit";

export default function ImportDialog({ file, onClose }: { file: FunctionFile; onClose: () => void }) {
  const points = useEditor((state) => state.doc?.points);
  const [chosen, setChosen] = useState<Record<string, string>>({});
  const [problem, setProblem] = useState("");
  const choices = Object.values(points ?? {}).sort(byName);
  const submit = async () => {
    const refused = await importFunction(file, chosen);
    setProblem(refused);
    if (!refused) onClose();
  };
  return (
    <ModalDialog title={t`Import a function`} onClose={onClose}>
      <p>{t`The function uses action points that this project lacks. Choose one for each.`}</p>
      {file.points.map((name) => (
        <SelectField
          key={name}
          label={t`Instead of ${name}`}
          value={chosen[name] ?? ""}
          choices={[["", t`choose…`], ...choices.map((each): [string, string] => [each.id, each.name])]}
          onChange={(id) => setChosen({ ...chosen, [name]: id })}
        />
      ))}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="actions">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" isDisabled={file.points.some((name) => !chosen[name])} onPress={() => void submit()}>
          {t`Import`}
        </Button>
      </div>
    </ModalDialog>
  );
}
