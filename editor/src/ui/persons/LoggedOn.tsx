/** The person who is logged on at this shared device, with log-off. Also reads the card of the next person. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { sentence } from "../../commands/requests";
import { call } from "../../session/connection";
import { logOff, logOn } from "../../session/logOn";
import { notify, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { useCards } from "./useCards";
import "./persons.css";

/** Least time between two reports of activity, ms; shorter if persons are logged off soon. */
const REPORT_AFTER = 10_000;

export default function LoggedOn() {
  const { user, logOffAfter } = useEditor((state) => state.connection);
  useCards((card) => void logOn({ card }).catch((error) => notify("error", sentence(error))));
  useEffect(() => {
    const pause = Math.min(REPORT_AFTER, logOffAfter * 300);
    let reported = -Infinity;
    const used = (event: Event) => {
      if (event.timeStamp - reported < pause) return;
      reported = event.timeStamp;
      call("KeepLoggedOn").catch(() => {}); // the connection is lost, and with it the log-on
    };
    const events = ["pointerdown", "keydown", "wheel"] as const;
    for (const each of events) window.addEventListener(each, used, { capture: true, passive: true });
    return () => {
      for (const each of events) window.removeEventListener(each, used, { capture: true });
    };
  }, [logOffAfter]);
  return (
    <Button
      className="logged-on"
      aria-label={t`Log off ${user}`}
      onPress={() => void logOff().catch((error) => notify("error", sentence(error)))}
    >
      <span className="logged-on-name" data-name={user}>
        {user}
      </span>
      <small>{t`Log off`}</small>
    </Button>
  );
}
