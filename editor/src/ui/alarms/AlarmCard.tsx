/** The alarm that an operator should see first: the event, its cause and its remedy. The others are folded below. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { ask } from "../../commands/requests";
import { ago } from "../../formats";
import { splitAddress } from "../../program/messages";
import { type AlarmRecord, ROLES } from "../../protocol/types";
import { rest } from "../../session/rest";
import { whyUnavailable } from "../../store/permissions";
import type { State } from "../../store/state";
import { useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { useTicking } from "../times";
import { firstUp, timesOf } from "./useAlarms";
import "./alarms.css";

/** Return why the user cannot acknowledge an alarm; an empty string if they can. */
function whyNotAcknowledged(state: State, record: AlarmRecord): string {
  if (record.acknowledge === "technician" && state.connection.role < ROLES.technician)
    return t`Only a technician can acknowledge this alarm.`;
  return whyUnavailable(state, "AcknowledgeAlarm");
}

export const acknowledge = (record: AlarmRecord) => ask("AcknowledgeAlarm", { number: record.number });

export function AlarmCard({ alarms }: { alarms: readonly AlarmRecord[] }) {
  useTicking();
  const { first, others } = firstUp(alarms);
  if (!first) return null;
  const count = others.length;
  return (
    <section className="alarms" aria-label={t`Alarm`}>
      <div className="alarm-card" role="alert" data-priority={first.priority} data-acknowledged={first.acknowledged}>
        <Icon name={first.acknowledged ? "check" : "warn"} size={64} />
        <div className="alarm-texts">
          <p className="alarm-where">
            {first.object_name ?? t`Program and server`}
            {first.action && <span className="quiet"> · {first.action}</span>}
          </p>
          <h2>{splitAddress(first.text).text}</h2>
          {first.cause && (
            <p className="alarm-why">
              <strong>{t`Why`}</strong> {first.cause}
            </p>
          )}
          {first.remedy && (
            <p className="alarm-do">
              <strong>{t`Do this`}</strong> {first.remedy}
            </p>
          )}
          <p className="quiet">
            {ago(first.raised)}
            {first.active && ` · ${t`still present`}`}
            {first.count > 1 && ` · ${timesOf(first.count)}`}
            {first.acknowledged_by && first.acknowledged && ` · ${t`acknowledged by ${first.acknowledged_by}`}`}
          </p>
        </div>
        {first.picture && <Picture number={first.number} />}
        {/* With a key, a press never acknowledges another alarm that has just taken this place. */}
        {!first.acknowledged && <Acknowledge key={first.number} record={first} />}
      </div>
      {count > 0 && (
        <details className="alarm-others">
          <summary>{plural(count, { one: "# more alarm", other: "# more alarms" })}</summary>
          <ul>
            {others.map((each) => (
              <li key={each.number} data-priority={each.priority}>
                <div>
                  <strong>{each.object_name ?? t`Program and server`}</strong> {splitAddress(each.text).text}
                  {each.remedy && <p className="quiet">{each.remedy}</p>}
                </div>
                {!each.acknowledged && <Acknowledge record={each} />}
              </li>
            ))}
          </ul>
        </details>
      )}
    </section>
  );
}

export function Acknowledge({ record }: { record: AlarmRecord }) {
  const why = useEditor((state) => whyNotAcknowledged(state, record));
  return (
    <Button className="alarm-acknowledge" icon="check" why={why} onPress={() => void acknowledge(record)}>
      {t`Acknowledge`}
    </Button>
  );
}

/**
 * The picture of an alarm. It is loaded with the token of the user, which an address cannot contain. Its space is
 * reserved, so that the button next to it does not move.
 */
export function Picture({ number }: { number: number }) {
  const [url, setUrl] = useState("");
  useEffect(() => {
    let made = "";
    rest(`/api/alarms/${number}/picture`)
      .then((response) => response.blob())
      .then((picture) => {
        made = URL.createObjectURL(picture);
        setUrl(made);
      })
      .catch(() => {}); // the text says the same
    return () => URL.revokeObjectURL(made);
  }, [number]);
  return <div className="alarm-picture">{url && <img src={url} alt="" />}</div>;
}
