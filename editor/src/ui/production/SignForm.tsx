/** The signature of a recipe: the person, the meaning, and the PIN. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { shownRecipe } from "../../commands/production";
import { refusal } from "../../commands/requests";
import type { ListPersonsData, Recipe } from "../../protocol/types";
import { call } from "../../session/connection";
import { Field } from "../kit/Field";
import { SelectField } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

const MEANINGS: Record<string, MessageDescriptor> = {
  tested: msg`I have tested it on this cell.`,
  released: msg`I release it for production.`,
  retired: msg`I retire it from production.`,
};

interface Props {
  recipe: Recipe;
  state: Recipe["state"];
  onClose: () => void;
  onSigned: () => void;
}

export function SignForm({ recipe, state, onClose, onSigned }: Props) {
  const [listed, setListed] = useState<ListPersonsData | null>(null);
  const [person, setPerson] = useState("");
  const [note, setNote] = useState("");
  const [pin, setPin] = useState("");
  const { refused, busy, ask } = useRefusal();
  useEffect(() => {
    void ask(
      refusal(async () => {
        const found = await call("ListPersons");
        setListed(found);
        setPerson(found.logged_on ?? found.persons.find((each) => each.pin)?.id ?? "");
      }),
    );
  }, []);
  const sign = async () => {
    const done = await ask(refusal(() => call("SignRecipe", { id: recipe.id, state, person, pin, note: note.trim() })));
    setPin("");
    if (done) onSigned();
  };
  const able = listed?.persons.filter(
    (each) => each.pin && (listed.logged_on === undefined || each.id === listed.logged_on),
  );
  const meaning = MEANINGS[state];
  return (
    <>
      <h3 data-name={recipe.product}>{shownRecipe(recipe)}</h3>
      {meaning && <p>{i18n._(meaning)}</p>}
      {listed === null && !refused && <Waiting>{t`Loading…`}</Waiting>}
      {able?.length === 0 && (
        <p className="error" role="alert">{t`Nobody can sign: add a person with a PIN under Settings, Persons.`}</p>
      )}
      {able && able.length > 0 && (
        <>
          <SelectField
            label={t`Person`}
            value={person}
            choices={able.map((each) => [each.id, each.name] as const)}
            onChange={setPerson}
          />
          <Field label={t`Note`} value={note} onChange={setNote} maxLength={500} />
          <Field
            label={t`PIN`}
            type="password"
            inputMode="numeric"
            autoComplete="off"
            value={pin}
            onChange={setPin}
            maxLength={12}
          />
        </>
      )}
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" isDisabled={busy || !person || pin.length < 4} onPress={() => void sign()}>
          {t`Sign`}
        </Button>
      </div>
    </>
  );
}
