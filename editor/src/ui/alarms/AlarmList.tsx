/** All alarms with filters, and the ones that occur most often or last longest. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { ask } from "../../commands/requests";
import { ago, clock, duration } from "../../formats";
import { translate } from "../../i18n/serverMessages";
import { splitAddress } from "../../program/messages";
import type { AlarmFrequency, AlarmRecord, AlarmStatisticsData, RecordingInfo } from "../../protocol/types";
import { call } from "../../session/connection";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { SelectField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { OpenRecording } from "../recording/OpenRecording";
import { useRecordings } from "../recording/useRecordings";
import { useTicking } from "../times";
import { Acknowledge } from "./AlarmCard";
import { PRIORITIES } from "./texts";
import { type Show, timesOf, useAlarms } from "./useAlarms";
import "./alarms.css";

/** Time for which the button shelves an alarm, s. */
const SHELVED_FOR = 3600;
const DAYS = 7;

export default function AlarmList() {
  const [show, setShow] = useState<Show | "worst">("retained");
  const choices = [
    ["retained", t`Open`],
    ["all", t`History`],
    ["shelved", t`Shelved`],
    ["worst", t`Statistics`],
  ] as const;
  return (
    <div className="alarm-list">
      <ToggleGroup label={t`Show`} value={show} choices={choices} onChange={setShow} />
      {show === "worst" ? <Worst /> : <Records key={show} show={show} />}
    </div>
  );
}

function Records({ show }: { show: Show }) {
  const alarms = useAlarms(show);
  const recordings = useRecordings();
  const [object, setObject] = useState("");
  useTicking();
  if (!alarms) return <p className="quiet">{t`Loading…`}</p>;
  const names = new Map(alarms.map((each) => [each.object_id ?? "-", each.object_name ?? t`Program and server`]));
  const shown = alarms.filter((each) => object === "" || (each.object_id ?? "-") === object);
  if (alarms.length === 0) return <p className="quiet">{t`No alarms.`}</p>;
  return (
    <>
      {names.size > 1 && (
        <SelectField
          label={t`Device`}
          value={object}
          choices={[["", t`All devices`] as const, ...names]}
          onChange={setObject}
        />
      )}
      <ul className="alarm-records">
        {shown.map((each) => (
          <Row key={each.number} record={each} recording={recordingOf(each, recordings)} />
        ))}
      </ul>
    </>
  );
}

/** Return the newest recording of an alarm. */
function recordingOf({ number }: AlarmRecord, recordings: readonly RecordingInfo[]): RecordingInfo | undefined {
  return recordings.find(({ alarms }) => alarms.some((each) => each.number === number));
}

interface RowProps {
  record: AlarmRecord;
  recording: RecordingInfo | undefined;
}

function Row({ record, recording }: RowProps) {
  const why = useEditor((state) => whyUnavailable(state, "ShelveAlarm"));
  const shelved = record.shelved_until;
  const shelve = (seconds: number) => void ask("ShelveAlarm", { number: record.number, seconds });
  return (
    <li data-priority={record.retain ? record.priority : undefined}>
      <div>
        <span className="tag">{i18n._(PRIORITIES[record.priority])}</span>{" "}
        <strong>{record.object_name ?? t`Program and server`}</strong> {splitAddress(record.text).text}
        <p className="quiet small">
          {ago(record.raised)}
          {record.active && ` · ${t`still present`}`}
          {record.count > 1 && ` · ${timesOf(record.count)}`}
          {record.acknowledged && ` · ${t`acknowledged by ${record.acknowledged_by ?? ""}`}`}
          {record.note && ` · ${record.note}`}
          {shelved && ` · ${t`shelved until ${clock(shelved)} by ${record.shelved_by ?? ""}`}`}
        </p>
      </div>
      <OpenRecording recording={recording} />
      {record.retain && !shelved && !record.acknowledged && <Acknowledge record={record} />}
      {shelved ? (
        <Button variant="plain" why={why} onPress={() => shelve(0)}>{t`Show again`}</Button>
      ) : (
        record.retain &&
        record.can_be_shelved && (
          <Button variant="plain" why={why} onPress={() => shelve(SHELVED_FOR)}>{t`Shelve for 1 h`}</Button>
        )
      )}
    </li>
  );
}

function Worst() {
  const [found, setFound] = useState<AlarmStatisticsData | null>(null);
  useEffect(() => {
    call("AlarmStatistics", { days: DAYS }).then(setFound, () => {});
  }, []);
  if (!found) return <p className="quiet">{t`Loading…`}</p>;
  if (found.by_count.length === 0) return <p className="quiet">{t`No alarms.`}</p>;
  return (
    <div className="alarm-worst">
      <Table title={t`Most frequent in 7 days`} rows={found.by_count} value={(each) => timesOf(each.count)} />
      <Table title={t`Longest in 7 days`} rows={found.by_duration} value={(each) => duration(each.duration)} />
    </div>
  );
}

interface TableProps {
  title: string;
  rows: AlarmFrequency[];
  value: (row: AlarmFrequency) => string;
}

function Table({ title, rows, value }: TableProps) {
  if (rows.length === 0) return null;
  return (
    <section>
      <h3>{title}</h3>
      <ol>
        {rows.map((each) => (
          <li key={`${each.object_id}/${each.code}`}>
            <span>
              <strong>{each.object_name ?? t`Program and server`}</strong>{" "}
              {splitAddress(translate(each.text_message ?? { text: each.text })).text}
            </span>
            <strong>{value(each)}</strong>
          </li>
        ))}
      </ol>
    </section>
  );
}
