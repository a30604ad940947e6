/** The persons who log on at shared devices, for administrators; a separate chunk. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useCallback, useEffect, useState } from "react";
import { refusal } from "../../commands/requests";
import { dateAndTime } from "../../formats";
import type { Person } from "../../protocol/types";
import { call } from "../../session/connection";
import { ROLE_NAMES, type RoleName } from "../../viewmodel/roles";
import { ModalDialog } from "../kit/dialogs";
import { Field } from "../kit/Field";
import { SelectField } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";
import { useCards } from "./useCards";
import "./persons.css";

export default function Persons({ onClose }: { onClose: () => void }) {
  const [persons, setPersons] = useState<readonly Person[] | null>(null);
  const [edited, setEdited] = useState<Person | "new" | null>(null);
  const [removed, setRemoved] = useState<Person | null>(null);
  const { refused, busy, ask } = useRefusal();
  const load = useCallback(async () => setPersons((await call("ListPersons")).persons), []);
  useEffect(() => {
    void ask(refusal(load));
  }, [load]);
  const send = (work: () => Promise<unknown>) =>
    ask(
      refusal(async () => {
        await work();
        await load();
      }),
    );
  if (edited)
    return (
      <PersonForm
        person={edited === "new" ? null : edited}
        onClose={() => setEdited(null)}
        onSaved={() => {
          setEdited(null);
          void ask(refusal(load));
        }}
      />
    );
  return (
    <ModalDialog title={t`Persons`} onClose={onClose}>
      <p className="quiet small">{t`They log on at shared devices. Programmers manage persons.`}</p>
      {persons === null && !refused && <Waiting>{t`Loading…`}</Waiting>}
      {persons?.length === 0 && <p className="quiet">{t`No persons yet.`}</p>}
      <ul className="persons">
        {persons?.map((each) => (
          <li key={each.id}>
            <span>
              <strong data-name={each.name}>{each.name}</strong>
              <span className="quiet small">
                {[i18n._(ROLE_NAMES[each.role]), each.pin && t`PIN`, each.card && t`card`].filter(Boolean).join(", ")}
              </span>
              {each.lock_outs.map(
                ({ device, until }) =>
                  until && (
                    <span key={device} className="small tag warn">
                      {t`Locked out at ${device} until ${dateAndTime(until)}`}
                    </span>
                  ),
              )}
            </span>
            {each.lock_outs.some(({ until }) => until) && (
              <Button
                isDisabled={busy}
                onPress={() => void send(() => call("ChangePerson", { id: each.id, unlock: true }))}
              >
                {t`Unlock`}
              </Button>
            )}
            <Button isDisabled={busy} aria-label={t`Change ${each.name}`} onPress={() => setEdited(each)}>
              {t`Change`}
            </Button>
            <Button
              variant="plain"
              icon="close"
              isDisabled={busy}
              aria-label={t`Remove ${each.name}`}
              onPress={() => setRemoved(each)}
            />
          </li>
        ))}
      </ul>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button icon="plus" isDisabled={persons === null} onPress={() => setEdited("new")}>
          {t`Add person`}
        </Button>
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
      {removed && (
        <Confirm
          title={t`Remove ${removed.name}?`}
          confirmLabel={t`Remove`}
          onConfirm={() => void send(() => call("RemovePerson", { id: removed.id }))}
          onClose={() => setRemoved(null)}
        >
          {t`They are logged off at once. The audit trail keeps the name.`}
        </Confirm>
      )}
    </ModalDialog>
  );
}

interface FormProps {
  person: Person | null;
  onClose: () => void;
  onSaved: () => void;
}

function PersonForm({ person, onClose, onSaved }: FormProps) {
  const [name, setName] = useState(person?.name ?? "");
  const [role, setRole] = useState<RoleName>(person?.role ?? "operator");
  const [pin, setPin] = useState("");
  const [card, setCard] = useState("");
  const [reading, setReading] = useState(false);
  const { refused, busy, ask } = useRefusal();
  useCards((read) => {
    setCard(read);
    setReading(false);
  }, reading);
  const save = async () => {
    const secrets = { ...(pin && { pin }), ...(card && { card }) };
    if (person) await call("ChangePerson", { id: person.id, name: name.trim(), role, ...secrets });
    else await call("AddPerson", { name: name.trim(), role, ...secrets });
    setPin("");
    onSaved();
  };
  return (
    <ModalDialog title={person ? t`Change ${person.name}` : t`Add person`} onClose={onClose}>
      <form
        className="person-form"
        onSubmit={(event) => {
          event.preventDefault();
          void ask(refusal(save));
        }}
      >
        <Field label={t`Name`} value={name} onChange={setName} maxLength={60} autoFocus autoComplete="off" />
        <SelectField
          label={t`Role`}
          value={role}
          choices={Object.entries(ROLE_NAMES).map(([key, words]) => [key, i18n._(words)] as const)}
          onChange={(next) => setRole(next as RoleName)}
        />
        <Field
          label={person?.pin ? t`New PIN` : t`PIN`}
          type="password"
          inputMode="numeric"
          value={pin}
          onChange={setPin}
          maxLength={12}
          autoComplete="off"
          hint={person?.pin ? t`Leave it empty to keep the PIN.` : t`4 to 12 digits, neither equal nor consecutive.`}
        />
        <div className="person-card">
          <Button aria-pressed={reading} onPress={() => setReading(!reading)}>
            {reading ? t`Hold the card to the reader…` : t`Read card`}
          </Button>
          <span role="status">
            {card ? t`A card was read.` : person?.card && !reading ? t`This person has a card.` : ""}
          </span>
        </div>
        <RefusedText>{refused}</RefusedText>
        <div className="actions">
          <Button onPress={onClose}>{t`Cancel`}</Button>
          <Button variant="primary" type="submit" isDisabled={busy || !name.trim()}>
            {t`Save`}
          </Button>
        </div>
      </form>
    </ModalDialog>
  );
}
