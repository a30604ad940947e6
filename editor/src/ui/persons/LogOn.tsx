/** The log-on screen of a shared device: names as tiles, PIN pad for gloves, cards, and the Stop button. */

import { t } from "@lingui/core/macro";
import { type ComponentType, type FormEvent, Suspense, useCallback, useEffect, useState } from "react";
import { refusal } from "../../commands/requests";
import type { ListPersonsData, Person } from "../../protocol/types";
import { call } from "../../session/connection";
import { logOn } from "../../session/logOn";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { Button, Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { colourOf, initials } from "../people/colours";
import { RefusedText, useRefusal } from "../points/Refusal";
import { PinPad } from "./PinPad";
import { useCards } from "./useCards";
import "../dock/dock.css";
import "../people/people.css";
import "./persons.css";

const LanguageChoice = lazyComponent(() =>
  import("../join/Join").then((module) => ({ default: module.LanguageChoice })),
);

/** `Stop` is the Stop button, and `Notices` shows what could not be stopped. */
export default function LogOn({ Stop, Notices }: { Stop: ComponentType; Notices: ComponentType }) {
  const { status, reason } = useEditor((state) => state.connection);
  const connected = status === "person";
  const [listed, setListed] = useState<ListPersonsData | null>(null);
  const [chosen, setChosen] = useState<Person | null>(null);
  const { refused, busy, ask } = useRefusal();

  const load = useCallback(async () => setListed(await call("ListPersons")), []);
  useEffect(() => {
    if (connected) void ask(refusal(load));
  }, [connected, load]);
  useCards((card) => void ask(refusal(() => logOn({ card }))));

  return (
    <div className="log-on">
      <main>
        <header>
          <h1>{listed?.needs_administrator ? t`First start` : chosen ? chosen.name : t`Who are you?`}</h1>
          <Suspense fallback={null}>
            <LanguageChoice />
          </Suspense>
        </header>
        {!connected && <Waiting>{reason || t`Connecting…`}</Waiting>}
        {connected && reason && !chosen && !refused && (
          <p className="notice-line" role="status">
            {reason}
          </p>
        )}
        {refused && (
          <p className="notice-line bad" role="alert">
            {refused}
          </p>
        )}
        {listed?.needs_administrator ? (
          <FirstAdministrator onDone={() => void ask(refusal(load))} />
        ) : chosen ? (
          <PinPad
            key={chosen.id}
            busy={busy || !connected}
            hasPin={chosen.pin}
            onPin={(pin) => ask(refusal(() => logOn({ person: chosen.id, pin })))}
            onBack={() => {
              setChosen(null);
              void ask(refusal(load));
            }}
          />
        ) : (
          <Tiles persons={listed?.persons ?? []} onChoose={setChosen} />
        )}
        {listed && !listed.needs_administrator && <p className="quiet">{t`Or hold your card to the reader.`}</p>}
      </main>
      <footer className="dock">
        <Stop />
      </footer>
      <Notices />
    </div>
  );
}

function Tiles({ persons, onChoose }: { persons: readonly Person[]; onChoose: (person: Person) => void }) {
  return (
    <div className="person-tiles" role="group" aria-label={t`Persons`}>
      {persons.map((each) => (
        <Button key={each.id} className="person-tile" onPress={() => onChoose(each)}>
          <span className="person" style={{ background: colourOf(each.name) }} aria-hidden="true">
            {initials(each.name)}
          </span>
          <span data-name={each.name}>{each.name}</span>
        </Button>
      ))}
    </div>
  );
}

/** The first start: no person can log on yet. */
function FirstAdministrator({ onDone }: { onDone: () => void }) {
  const [name, setName] = useState("");
  const [pin, setPin] = useState("");
  const [again, setAgain] = useState("");
  const { refused, busy, ask } = useRefusal();
  const differs = again !== "" && again !== pin;
  const submit = (event: FormEvent) => {
    event.preventDefault();
    void ask(
      refusal(async () => {
        const { id } = await call("CreateAdministrator", { name: name.trim(), pin });
        await logOn({ person: id, pin });
      }),
    ).then((done) => done || onDone());
  };
  return (
    <form className="first-administrator" onSubmit={submit}>
      <p>{t`Nobody can log on yet. Add the administrator, who then adds the other persons.`}</p>
      <Field label={t`Name`} value={name} onChange={setName} maxLength={60} autoFocus autoComplete="off" />
      <Field
        label={t`PIN`}
        type="password"
        inputMode="numeric"
        value={pin}
        onChange={setPin}
        maxLength={12}
        autoComplete="off"
        hint={t`4 to 12 digits, neither equal nor consecutive.`}
      />
      <Field
        label={t`PIN again`}
        type="password"
        inputMode="numeric"
        value={again}
        onChange={setAgain}
        maxLength={12}
        autoComplete="off"
        isInvalid={differs}
      />
      {differs && <p className="error small">{t`The two PINs differ.`}</p>}
      <RefusedText>{refused}</RefusedText>
      <Button variant="primary" type="submit" isDisabled={busy || !name.trim() || pin.length < 4 || pin !== again}>
        {t`Add administrator`}
      </Button>
    </form>
  );
}
