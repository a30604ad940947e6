/** The users who are connected, and those who left and still hold locks. */

import { plural, t } from "@lingui/core/macro";
import { Suspense, useState } from "react";
import { compareTexts } from "../../formats";
import { serves } from "../../session/connection";
import { absentLockHolders } from "../../store/absentUsers";
import { getState, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { colourOf, initials } from "./colours";
import "./people.css";

const LoggedOn = lazyComponent(() => import("../persons/LoggedOn"));
const TakeOver = lazyComponent(() => import("./TakeOver"));

export function People() {
  const users = useEditor((state) => state.users);
  const { user: me, shared } = useEditor((state) => state.connection);
  const doc = useEditor((state) => state.doc);
  const called = (name: string) => {
    if (name === me) return t`${name} (you)`;
    const looked = users[name]?.presence?.selected[0];
    const thing = looked && doc ? nameOf(getState(), looked) : "";
    return thing ? t`${name}, at ${thing}` : name;
  };
  const names = [
    me,
    ...Object.keys(users)
      .filter((name) => name !== me)
      .sort(compareTexts),
  ];
  const shown = names.slice(0, 4);
  return (
    <div
      className="people"
      role="group"
      aria-label={
        names.length === 1
          ? t`Only you are connected`
          : plural(names.length, { one: "# user connected", other: "# users connected" })
      }
    >
      {shown.map((name) => (
        <span
          key={name}
          className="person"
          title={called(name)}
          style={{ background: colourOf(name) }}
          role="img"
          aria-label={called(name)}
        >
          {initials(name)}
        </span>
      ))}
      {names.length > shown.length && (
        <span className="person more-people">
          <Icon name="people" size={16} />+{names.length - shown.length}
        </span>
      )}
      <Gone />
      {shared && (
        <Suspense fallback={null}>
          <LoggedOn />
        </Suspense>
      )}
    </div>
  );
}

/** Users who left and still hold locks; pressing one offers to take over. */
function Gone() {
  // Joined to a text: a selector has to return the same value for the same state.
  const gone = useEditor((state) => absentLockHolders(state).join("\n"));
  const [asked, setAsked] = useState("");
  if (!serves("TakeOverLocks")) return null;
  return (
    <>
      {gone
        .split("\n")
        .filter(Boolean)
        .map((name) => (
          <Button
            key={name}
            variant="plain"
            className="gone"
            aria-label={t`${name} left and still holds locks: take over`}
            onPress={() => setAsked(name)}
          >
            <span className="person" aria-hidden="true">
              {initials(name)}
            </span>
            <Icon name="lock" size={16} />
            <span className="gone-word">{t`${name} left`}</span>
          </Button>
        ))}
      {asked && (
        <Suspense fallback={null}>
          <TakeOver user={asked} onClose={() => setAsked("")} />
        </Suspense>
      )}
    </>
  );
}
