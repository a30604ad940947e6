/** Asks before the locks of a user who left are released: what is locked, by whom, and since when. */

import { useEffect, useState } from "react";
import { ask, barred } from "../../commands/asking";
import type { LockHolder } from "../../protocol/types";
import { now, tell, useEditor } from "../../store/store";
import { Confirm } from "../kit/dialogs";
import { nameOf } from "../names";
import { ago } from "../times";

export default function TakeOver({ user, onClose }: { user: string; onClose: () => void }) {
  const [holder, setHolder] = useState<LockHolder | null>(null);
  const [missing, setMissing] = useState(false);
  const cannot = useEditor((state) => barred(state, "TakeOverLocks"));
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
  const not =
    cannot ||
    (present
      ? `${user} is connected again.`
      : missing
        ? `${user} holds no locks any more.`
        : holder
          ? ""
          : "Wait until the locks are listed.");
  const takeOver = async () => {
    const answer = await ask("TakeOverLocks", { user });
    if (answer) tell("info", `You took over from ${user}: ${answer.data.locks.map(called).join(", ")}.`);
  };
  return (
    <Confirm
      title={`Take over from ${user}?`}
      yes="Take over"
      not={not}
      onYes={() => void takeOver()}
      onClose={onClose}
    >
      {missing || present ? (
        <p>{not}</p>
      ) : !holder ? (
        <p role="status">Reading the locks…</p>
      ) : (
        <>
          <p>
            {holder.left
              ? `${user} lost the connection at ${when(holder.left)} and still holds:`
              : `${user} still holds:`}
          </p>
          <ul className="taken-over">
            {holder.locks.map((lock) => (
              <li key={lock.object_id}>
                <strong>{called(lock)}</strong>, since {when(lock.since)}
              </li>
            ))}
          </ul>
          <p>
            Everybody can edit these afterwards. Changes made by {user} stay. {user} is notified on returning.
          </p>
        </>
      )}
    </Confirm>
  );
}

function called({ object_id, name }: LockHolder["locks"][number]): string {
  return name || nameOf(now(), object_id) || "an item that is not open";
}

/** "12:31 (5 minutes ago)". */
function when(time: string): string {
  const clock = new Date(time).toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  return `${clock} (${ago(time)})`;
}
