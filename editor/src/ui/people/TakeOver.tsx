/** Confirm that the locks of a user who left are released: list the locked items. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { ask } from "../../commands/requests";
import { ago, clock } from "../../formats";
import type { LockHolder } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { getState, notify, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Confirm } from "../kit/dialogs";

export default function TakeOver({ user, onClose }: { user: string; onClose: () => void }) {
  const [holder, setHolder] = useState<LockHolder | null>(null);
  const [missing, setMissing] = useState(false);
  const cannot = useEditor((state) => whyUnavailable(state, "TakeOverLocks"));
  const present = useEditor((state) => state.users[user]?.online === true);
  useEffect(() => {
    let shown = true;
    void ask("ListLocks").then((answer) => {
      const found = answer?.data.find((each) => each.user === user);
      if (shown && found) setHolder(found);
      else if (shown) setMissing(true);
    });
    return () => {
      shown = false;
    };
  }, [user]);
  const why =
    cannot ||
    (present
      ? t`${user} is connected again.`
      : missing
        ? t`${user} holds no locks.`
        : holder
          ? ""
          : t`Wait until the locks are listed.`);
  const takeOver = async () => {
    const answer = await ask("TakeOverLocks", { user });
    if (answer) notify("info", t`You took over from ${user}: ${answer.data.locks.map(called).join(", ")}.`);
  };
  return (
    <Confirm
      title={t`Take over from ${user}?`}
      confirmLabel={t`Take over`}
      why={why}
      onConfirm={() => void takeOver()}
      onClose={onClose}
    >
      {missing || present ? (
        <p>{why}</p>
      ) : !holder ? (
        <p role="status">{t`Loading…`}</p>
      ) : (
        <>
          <p>
            {holder.left
              ? t`${user} lost the connection at ${when(holder.left)} and still holds:`
              : t`${user} still holds:`}
          </p>
          <ul className="taken-over">
            {holder.locks.map((lock) => (
              <li key={lock.object_id}>{t`${called(lock)}, since ${when(lock.since)}`}</li>
            ))}
          </ul>
          <p>{t`Everybody can then edit these. Changes made by ${user} are kept. ${user} is notified on returning.`}</p>
        </>
      )}
    </Confirm>
  );
}

function called({ object_id, name }: LockHolder["locks"][number]): string {
  return name || nameOf(getState(), object_id) || t`an item that is not open`;
}

/** Return "12:31 (5 minutes ago)". */
function when(time: string): string {
  return `${clock(time)} (${ago(time)})`;
}
