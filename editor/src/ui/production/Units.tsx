/** Records of units by serial number, and the production of the cell. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { Input, Label, SearchField } from "react-aria-components";
import { exportUnits, shownRecipe } from "../../commands/production";
import { refusal } from "../../commands/requests";
import { dateAndTime, decimal, hours } from "../../formats";
import type { Production, Unit, UnitRecord } from "../../protocol/types";
import { call } from "../../session/connection";
import { ToggleGroup } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { ACTIVITIES, UNIT_STATES, UNIT_TONES } from "./texts";
import { nameOf, UnitDetails } from "./UnitDetails";

/** Number of units that a search loads. */
const MOST = 100;
const HOUR = 3_600_000;

type Period = "8" | "24" | "168";

export function Units({ onClose }: { onClose: () => void }) {
  const [serial, setSerial] = useState("");
  const [units, setUnits] = useState<readonly Unit[] | null>(null);
  const [opened, setOpened] = useState<UnitRecord | null>(null);
  const { refused, busy, ask } = useRefusal();
  useEffect(() => {
    let outdated = false;
    const timer = setTimeout(() => {
      void ask(
        refusal(async () => {
          const found = await call("ListUnits", { serial: serial.trim(), limit: MOST });
          if (!outdated) setUnits(found.units);
        }),
      );
    }, 200);
    return () => {
      outdated = true;
      clearTimeout(timer);
    };
  }, [serial]);
  if (opened) return <Details unit={opened} onBack={() => setOpened(null)} />;
  return (
    <>
      <Numbers />
      <SearchField className="field search" value={serial} onChange={setSerial}>
        <Label className="hidden-but-read">{t`Search by serial number`}</Label>
        <Input placeholder={t`Serial number`} />
      </SearchField>
      <div className="units" tabIndex={0} role="group" aria-label={t`Units, newest first`}>
        {units === null && !refused && <Waiting>{t`Loading…`}</Waiting>}
        {units?.length === 0 && <p className="quiet">{t`No unit matches.`}</p>}
        <ul>
          {units?.map((unit) => (
            <li key={unit.number}>
              <Button
                variant="plain"
                isDisabled={busy}
                onPress={() => void ask(refusal(async () => setOpened(await call("GetUnit", { number: unit.number }))))}
              >
                <strong data-name={unit.serial}>{nameOf(unit)}</strong>
                <span className={`tag ${UNIT_TONES[unit.state]}`}>{i18n._(UNIT_STATES[unit.state])}</span>
                <span className="quiet small">{dateAndTime(unit.left ?? unit.entered)}</span>
                {unit.recipe && (
                  <span className="quiet small" data-name={unit.recipe.product}>
                    {shownRecipe(unit.recipe)}
                  </span>
                )}
              </Button>
            </li>
          ))}
        </ul>
      </div>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button
          icon="save"
          isDisabled={busy}
          onPress={() => void ask(refusal(() => exportUnits(serial.trim())))}
        >{t`Export`}</Button>
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
    </>
  );
}

/** The production of the cell in a period. */
function Numbers() {
  const [period, setPeriod] = useState<Period>("8");
  const [found, setFound] = useState<Production | null>(null);
  useEffect(() => {
    let current = true;
    const since = new Date(Date.now() - Number(period) * HOUR).toISOString();
    call("GetProduction", { since }).then(
      (answer) => current && setFound(answer),
      () => {}, // offline: shown again after the reconnect
    );
    return () => {
      current = false;
    };
  }, [period]);
  const part = (value?: number) => (value === undefined ? "–" : `${decimal(value * 100, 1)} %`);
  const tiles: [string, string, string?][] = found
    ? [
        [t`Good`, decimal(found.counts.good), "good"],
        [t`Bad`, decimal(found.counts.bad), found.counts.bad ? "bad" : ""],
        [t`Rejected`, decimal(found.counts.rejected)],
        [t`In the cell`, decimal(found.counts.in_cell)],
        [t`Availability`, part(found.effectiveness.availability)],
        [t`Performance`, part(found.effectiveness.performance)],
        [t`Quality`, part(found.effectiveness.quality)],
        [t`OEE`, part(found.effectiveness.oee)],
      ]
    : [];
  return (
    <section className="numbers" aria-label={t`Numbers of the period`}>
      <ToggleGroup
        label={t`Period`}
        quiet
        value={period}
        choices={[
          ["8", t`8 hours`],
          ["24", t`24 hours`],
          ["168", t`7 days`],
        ]}
        onChange={setPeriod}
      />
      <dl>
        {tiles.map(([name, value, tone]) => (
          <div key={name} data-tone={tone}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      {found && (
        <p className="quiet small">
          {Object.entries(ACTIVITIES)
            .filter(([key]) => (found.seconds[key] ?? 0) > 0)
            .map(([key, name]) => `${i18n._(name)}: ${hours(found.seconds[key] ?? 0)}`)
            .join(" · ")}
        </p>
      )}
      {found && found.effectiveness.oee === undefined && (
        <p className="quiet small">{t`OEE needs units, and a planned rate in the recipe of each of them.`}</p>
      )}
    </section>
  );
}

function Details({ unit, onBack }: { unit: UnitRecord; onBack: () => void }) {
  return (
    <>
      <h3 data-name>{nameOf(unit)}</h3>
      <UnitDetails unit={unit} />
      <div className="actions">
        <Button onPress={onBack}>{t`Back`}</Button>
      </div>
    </>
  );
}
