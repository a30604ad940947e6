/** Alarms of all cells: the most frequent causes, and all of them with their times. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { dateAndTime, decimal, hours } from "../formats";
import { translate } from "../i18n/serverMessages";
import { splitAddress } from "../program/messages";
import type { AlarmSummary, FleetAlarm, FleetCause } from "../protocol/types";
import { PRIORITIES } from "../ui/alarms/texts";
import { Waiting } from "../ui/kit/kit";
import { RefusedText } from "../ui/points/Refusal";
import { Filters } from "./Filters";
import { Listed } from "./Listed";
import { type Choice, loadAlarms, loadCauses, periodOf } from "./results";
import { Table } from "./Table";
import { useLoaded, usePages } from "./useResults";
import "./results.css";

interface ViewProps {
  choice: Choice;
  cells: readonly string[];
  onChange: (choice: Choice) => void;
}

export default function AlarmsView({ choice, cells, onChange }: ViewProps) {
  const key = JSON.stringify(choice);
  const query = () => ({ ...periodOf(choice, Date.now()), cell: choice.cell });
  const causes = useLoaded(key, () => loadCauses(query()));
  const pages = usePages<FleetAlarm>(key, (last) => loadAlarms(query(), last));
  return (
    <>
      <Filters choice={choice} cells={cells} onChange={onChange} />
      <section className="fleet-list">
        <h2>{t`Most frequent causes`}</h2>
        {!causes.data && !causes.failed && <Waiting>{t`Loading…`}</Waiting>}
        <RefusedText>{causes.failed}</RefusedText>
        {causes.data?.length === 0 && <p className="quiet">{t`No alarms.`}</p>}
        {causes.data && causes.data.length > 0 && <Causes causes={causes.data} />}
      </section>
      <section className="fleet-list">
        <h2>{t`Alarms of the period`}</h2>
        <Listed pages={pages} empty={t`No alarms.`} file="alarms" query={query()}>
          {(entries) => <Alarms alarms={entries} />}
        </Listed>
      </section>
    </>
  );
}

/** Return the text of an alarm, without the address that is for technicians. */
function textOf({ record, translations }: AlarmSummary): string {
  return splitAddress(translate(record.text_message ?? { text: record.text }, translations)).text;
}

const deviceOf = ({ record }: AlarmSummary) => record.object_name ?? t`Program and server`;

const tag = ({ record }: AlarmSummary) => (
  <span className={`tag ${{ urgent: "bad", high: "bad", medium: "warn", low: "" }[record.priority]}`}>
    {i18n._(PRIORITIES[record.priority])}
  </span>
);

function Causes({ causes }: { causes: readonly FleetCause[] }) {
  const most = Math.max(...causes.map((each) => each.count));
  const columns = [
    { name: t`Alarm` },
    { name: t`Cell` },
    { name: t`Device` },
    { name: t`Count`, number: true },
    { name: t`Total duration`, number: true },
  ];
  const rows = causes.map((each) => ({
    key: JSON.stringify([each.cell, each.newest.record.kind, each.newest.record.code, each.newest.record.object_id]),
    cells: [
      textOf(each.newest),
      each.cell,
      deviceOf(each.newest),
      <span key="count" className="fleet-often">
        <meter min={0} max={most} value={each.count} aria-hidden="true" />
        {decimal(each.count)}
      </span>,
      hours(each.duration),
    ],
  }));
  return <Table title={t`Most frequent causes`} columns={columns} rows={rows} />;
}

function Alarms({ alarms }: { alarms: readonly FleetAlarm[] }) {
  const columns = [
    { name: t`Raised` },
    { name: t`Cell` },
    { name: t`Device` },
    { name: t`Alarm` },
    { name: t`Priority` },
    { name: t`Duration`, number: true },
  ];
  const rows = alarms.map(({ id, at, cell, duration, alarm }) => ({
    key: id,
    cells: [
      dateAndTime(new Date(at * 1000).toISOString()),
      cell,
      deviceOf(alarm),
      alarm.record.count > 1 ? `${textOf(alarm)} (${alarm.record.count}×)` : textOf(alarm),
      <span key="priority">{tag(alarm)}</span>,
      alarm.record.active ? t`${hours(duration)}, still present` : hours(duration),
    ],
  }));
  return <Table title={t`Alarms`} columns={columns} rows={rows} />;
}
