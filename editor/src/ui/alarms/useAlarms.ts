/** The alarms of the server, followed while a component shows them. */

import { plural } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { translate, translatedAlarm } from "../../i18n/serverMessages";
import type { AlarmRecord } from "../../protocol/types";
import { call, serves } from "../../session/connection";
import { getState, useEditor } from "../../store/store";

/** Maximum number of alarms that a list loads. */
const MAX_ALARMS = 200;

export type Show = "retained" | "shelved" | "all";

/** Return whether a list with this filter contains an alarm. */
function isShown(record: AlarmRecord, show: Show): boolean {
  if (show === "all") return true;
  return show === "shelved" ? record.shelved_until !== undefined : record.retain && record.shelved_until === undefined;
}

/** Return alarms with a changed one, newest first. */
export function withChanged(alarms: readonly AlarmRecord[], changed: AlarmRecord, show: Show): AlarmRecord[] {
  const others = alarms.filter((each) => each.number !== changed.number);
  return isShown(changed, show) ? [...others, changed].sort((a, b) => b.number - a.number) : others;
}

/** Return the alarms that the filter selects, in the user's language; null until they are loaded. */
export function useAlarms(show: Show): AlarmRecord[] | null {
  const ready = useEditor((state) => state.connection.status === "ready");
  const [alarms, setAlarms] = useState<AlarmRecord[] | null>(null);
  useEffect(() => {
    if (!ready || !serves("ListAlarms")) return;
    let current = true;
    const { runtime } = getState();
    runtime.takeAlarm ??= new Set();
    const listeners = runtime.takeAlarm;
    const take = (record: AlarmRecord) => setAlarms((known) => withChanged(known ?? [], translated(record), show));
    listeners.add(take);
    call("ListAlarms", { show, limit: MAX_ALARMS }).then(
      (answer) => current && setAlarms(answer.alarms.map(translated)),
      () => current && setAlarms((known) => known ?? []), // offline: loaded again after the reconnect
    );
    return () => {
      current = false;
      listeners.delete(take);
    };
  }, [ready, show]);
  return alarms;
}

function translated(record: AlarmRecord): AlarmRecord {
  return { ...translatedAlarm(record), cause: translate({ text: record.cause }) };
}

/** Return a number of occurrences in words. */
export const timesOf = (count: number): string => plural(count, { one: "# time", other: "# times" });

/** The order of priorities, most urgent first. */
const PRIORITIES = ["urgent", "high", "medium", "low"];

/** Return the first alarm that the operator should see, and the others: the first-up of the most urgent group. */
export function firstUp(alarms: readonly AlarmRecord[]): { first: AlarmRecord | undefined; others: AlarmRecord[] } {
  const groups = new Map<number, AlarmRecord[]>();
  for (const each of alarms) groups.set(each.first_up, [...(groups.get(each.first_up) ?? []), each]);
  const urgency = (group: AlarmRecord[]) => Math.min(...group.map((each) => PRIORITIES.indexOf(each.priority)));
  const oldest = (group: AlarmRecord[]) => Math.min(...group.map((each) => each.number));
  // Unacknowledged alarms come first, then the most urgent ones, then the oldest ones.
  const seen = (group: AlarmRecord[]) => Number(group.every((each) => each.acknowledged));
  const [group] = [...groups.values()].sort(
    (a, b) => seen(a) - seen(b) || urgency(a) - urgency(b) || oldest(a) - oldest(b),
  );
  const first = group?.find((each) => each.number === each.first_up) ?? group?.at(-1);
  const others = alarms.filter((each) => each !== first);
  const follows = (each: AlarmRecord) => Number(each.first_up !== first?.first_up);
  return { first, others: others.sort((a, b) => follows(a) - follows(b) || a.number - b.number) };
}
