/** The first screen: name, and token if the server requires one. The name is remembered. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { LANGUAGES, type Language, useLanguage } from "../../i18n/catalogue";
import { displayIn } from "../../session/language";
import { recentUsers, remember, remembered } from "../../session/localStorage";
import { theSession } from "../../session/session";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { Button, Waiting } from "../kit/kit";
import "./join.css";

export default function Join() {
  const { status, reason, needsToken } = useEditor((state) => state.connection);
  const [name, setName] = useState(() => remembered("name"));
  const [token, setToken] = useState(() => remembered("token"));
  const trying = status === "connecting" || status === "joining";
  const [people] = useState(recentUsers);
  const enter = (user: string) => {
    const clean = user.trim();
    if (!clean) return;
    setName(clean);
    remember("name", clean);
    remember("token", token.trim());
    theSession().join(clean, token.trim());
  };
  const submit = (event: FormEvent) => {
    event.preventDefault();
    enter(name);
  };
  return (
    <main className="join">
      <form onSubmit={submit}>
        <h1>ARCOR2-HW</h1>
        <p className="quiet">{t`Set up, program and run this workplace.`}</p>
        <Field
          label={t`Your name`}
          value={name}
          onChange={setName}
          autoFocus
          autoComplete="nickname"
          maxLength={60}
          hint={t`Shown to other users.`}
        />
        {people.length > 0 && (
          <div className="people-here" role="group" aria-label={t`Recent users`}>
            {people.map((each) => (
              <Button
                key={each}
                aria-label={t`Join as ${each}`}
                isDisabled={status === "joining"}
                onPress={() => enter(each)}
              >
                {each}
              </Button>
            ))}
          </div>
        )}
        {(needsToken || token) && (
          <Field
            label={t`Token`}
            type="password"
            value={token}
            onChange={setToken}
            autoComplete="off"
            hint={t`The administrator creates it: arcor2-hw token add`}
          />
        )}
        {status === "refused" && (
          <p role="alert" className="notice-line bad">
            {reason}
          </p>
        )}
        {trying && <Waiting>{reason ? t`${reason} Reconnecting…` : t`Connecting…`}</Waiting>}
        <Button variant="primary" type="submit" isDisabled={!name.trim() || status === "joining"}>
          {t`Join`}
        </Button>
        <LanguageChoice />
      </form>
    </main>
  );
}

/** The language before login. After joining, the page uses the language that the user has chosen. */
export function LanguageChoice() {
  const language = useLanguage();
  return (
    <div className="field">
      <select
        aria-label={t`Language`}
        value={language}
        onChange={(event) => void displayIn(event.target.value as Language).catch(() => {})} // offline: it stays
      >
        {Object.entries(LANGUAGES).map(([each, name]) => (
          <option key={each} value={each} lang={each}>
            {name}
          </option>
        ))}
      </select>
    </div>
  );
}
