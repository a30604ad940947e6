/** Units of all cells: counts, bad units with their reasons, and a search by serial number. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { Input, Label, SearchField } from "react-aria-components";
import { dateAndTime, decimal } from "../formats";
import { translate } from "../i18n/serverMessages";
import type { FleetProduction, FleetUnit } from "../protocol/types";
import { ModalDialog } from "../ui/kit/dialogs";
import { SwitchField } from "../ui/kit/fields";
import { Button, Waiting } from "../ui/kit/kit";
import { RefusedText } from "../ui/points/Refusal";
import { UNIT_STATES, UNIT_TONES } from "../ui/production/texts";
import { nameOf, UnitDetails } from "../ui/production/UnitDetails";
import { Filters } from "./Filters";
import { Listed } from "./Listed";
import {
  byCell,
  type Choice,
  type Counts,
  loadProduction,
  loadUnit,
  loadUnits,
  periodOf,
  type Query,
  sumOf,
  yieldOf,
} from "./results";
import { Table } from "./Table";
import { UnitsChart } from "./UnitsChart";
import { useLoaded, usePages } from "./useResults";
import "./results.css";

/** Time without typing after which the search starts, ms. */
const TYPING = 250;

interface ViewProps {
  choice: Choice;
  cells: readonly string[];
  onChange: (choice: Choice) => void;
}

export default function UnitsView({ choice, cells, onChange }: ViewProps) {
  const key = JSON.stringify(choice);
  const { data, failed } = useLoaded(key, () => loadProduction({ ...periodOf(choice, Date.now()), cell: choice.cell }));
  return (
    <>
      <Filters choice={choice} cells={cells} onChange={onChange} />
      {!data && !failed && <Waiting>{t`Loading…`}</Waiting>}
      <RefusedText>{failed}</RefusedText>
      {data && <Produced production={data} />}
      <div className="fleet-columns">
        {data && <ByCell production={data} single={choice.cell !== ""} />}
        <Units choice={choice} />
      </div>
    </>
  );
}

const share = (counts: Counts) => {
  const found = yieldOf(counts);
  return found === undefined ? "–" : `${decimal(found * 100, 1)}\u00a0%`;
};

const timeOf = (seconds: number) => dateAndTime(new Date(seconds * 1000).toISOString());

function Produced({ production }: { production: FleetProduction }) {
  const [since, until] = [timeOf(production.since), timeOf(production.until)];
  const sum = sumOf(production.counts);
  const empty = sum.good + sum.bad + sum.rejected === 0;
  const facts: [string, string, string?][] = [
    [t`Good`, decimal(sum.good), "good"],
    [t`Bad`, decimal(sum.bad), sum.bad ? "bad" : ""],
    [t`Rejected`, decimal(sum.rejected)],
    [t`Yield`, share(sum)],
  ];
  return (
    <section className="fleet-numbers" aria-label={t`Numbers of the period`}>
      <dl>
        {facts.map(([name, value, tone]) => (
          <div key={name} data-tone={tone}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <p className="quiet small">{t`From ${since} to ${until}`}</p>
      {empty && <p className="quiet">{t`No unit left a cell in this period.`}</p>}
      {!empty && <UnitsChart production={production} />}
    </section>
  );
}

/** Units by cell; also by product and program if the user wants it or chose one cell. */
function ByCell({ production, single }: { production: FleetProduction; single: boolean }) {
  const [wanted, setWanted] = useState(false);
  const products = single || wanted;
  const columns = [
    { name: t`Cell` },
    { name: t`Good`, number: true },
    { name: t`Bad`, number: true },
    { name: t`Rejected`, number: true },
    { name: t`Yield`, number: true },
  ];
  const numbers = (counts: Counts) => [
    decimal(counts.good),
    decimal(counts.bad),
    decimal(counts.rejected),
    share(counts),
  ];
  const rows = byCell(production.counts).flatMap((each) => [
    {
      key: each.cell,
      cells: [
        <strong key="name" data-name>
          {each.cell}
        </strong>,
        ...numbers(each),
      ],
    },
    ...(products ? each.parts : []).map((part) => ({
      key: JSON.stringify([part.cell, part.product, part.program]),
      part: true,
      cells: [[part.product, part.program].filter(Boolean).join(" · ") || "–", ...numbers(part)],
    })),
  ]);
  if (rows.length === 0) return null;
  return (
    <section className="fleet-list">
      <h2>{t`Units by cell`}</h2>
      {!single && (
        <SwitchField isSelected={wanted} onChange={setWanted}>
          {t`By product and program`}
        </SwitchField>
      )}
      <div className="fleet-scroll" tabIndex={0} role="group" aria-label={t`Units by cell`}>
        <Table title={t`Units by cell`} columns={columns} rows={rows} narrow />
      </div>
    </section>
  );
}

/** The bad units of the period, or all units with a serial number, independent of the period. */
function Units({ choice }: { choice: Choice }) {
  const [typed, setTyped] = useState("");
  const [opened, setOpened] = useState<FleetUnit | null>(null);
  const [serial, setSerial] = useState("");
  useEffect(() => {
    const timer = setTimeout(() => setSerial(typed.trim()), TYPING);
    return () => clearTimeout(timer);
  }, [typed]);
  const query = (): Query =>
    serial ? { serial, cell: choice.cell } : { ...periodOf(choice, Date.now()), cell: choice.cell };
  const key = serial ? JSON.stringify([serial, choice.cell]) : JSON.stringify(choice);
  const pages = usePages<FleetUnit>(key, (last) => loadUnits(query(), last));
  const columns = [
    { name: t`Unit` },
    { name: t`Cell` },
    { name: t`State` },
    { name: t`Left the cell` },
    { name: t`Product` },
    { name: t`Reason` },
  ];
  const row = (each: FleetUnit) => ({
    key: each.id,
    cells: [
      <Button key="open" variant="plain" onPress={() => setOpened(each)}>
        <strong data-name>{nameOf(each.unit)}</strong>
      </Button>,
      <span key="cell" data-name>
        {each.cell}
      </span>,
      <span key="state" className={`tag ${UNIT_TONES[each.unit.state]}`}>
        {i18n._(UNIT_STATES[each.unit.state])}
      </span>,
      timeOf(each.at),
      each.unit.product || each.unit.program || "–",
      reasonOf(each),
    ],
  });
  return (
    <section className="fleet-list">
      <h2>{serial ? t`Found units` : t`Bad units of the period`}</h2>
      <SearchField className="field search" value={typed} onChange={setTyped}>
        <Label>{t`Search all units by serial number`}</Label>
        <Input placeholder={t`Serial number`} autoComplete="off" />
      </SearchField>
      <Listed
        pages={pages}
        empty={serial ? t`No unit matches.` : t`No bad units in this period.`}
        file="units"
        query={query()}
      >
        {(entries) => <Table title={t`Units`} columns={columns} rows={entries.map(row)} />}
      </Listed>
      {opened && <OpenedUnit unit={opened} onClose={() => setOpened(null)} />}
    </section>
  );
}

/** Return why a unit is bad, as far as its record contains it; an empty string for other units. */
export function reasonOf({ unit }: Pick<FleetUnit, "unit">): string {
  if (unit.state !== "bad" && unit.state !== "rejected") return "";
  if (unit.error) return `${unit.step}: ${translate(unit.message ?? { text: unit.error }, unit.translations)}`;
  if (unit.step) return t`${unit.step}: failed`;
  return unit.verdict === false ? t`Test failed` : "–";
}

function OpenedUnit({ unit, onClose }: { unit: FleetUnit; onClose: () => void }) {
  const { data, failed } = useLoaded(String(unit.id), () => loadUnit(unit.id));
  return (
    <ModalDialog title={`${nameOf(unit.unit)} · ${unit.cell}`} onClose={onClose}>
      {!data && !failed && <Waiting>{t`Loading…`}</Waiting>}
      <RefusedText>{failed}</RefusedText>
      {data && <UnitDetails unit={data} translations={unit.unit.translations} />}
      <div className="actions">
        <Button variant="primary" onPress={onClose}>{t`Close`}</Button>
      </div>
    </ModalDialog>
  );
}
