/** The card of one device. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { differenceOf, IDENTITY_FIELDS, type IdentityField } from "../../commands/maintenance";
import { dateAndTime, decimal } from "../../formats";
import { translate } from "../../i18n/serverMessages";
import { words } from "../../program/naming";
import type { DeviceCard } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Records } from "../calibrate/Records";
import { Button } from "../kit/kit";
import { stateName } from "../workplace/sections/about";
import { Backups } from "./Backups";

export const IDENTITY_NAMES: Record<IdentityField, MessageDescriptor> = {
  vendor: msg`Manufacturer`,
  model: msg`Model`,
  serial: msg`Serial number`,
  firmware: msg`Firmware`,
};

interface Props {
  card: DeviceCard;
  reload: () => Promise<void>;
  onReplace: () => void;
}

export function Card({ card, reload, onReplace }: Props) {
  const state = useEditor((all) => all.live.objects[card.object_id]);
  const object = useEditor((all) => all.doc?.objects[card.object_id]);
  const technician = useEditor((all) => whyUnavailable(all, "ConfirmDevice") === "");
  const shown = state?.state ?? "offline";
  const counters = Object.entries(card.counters ?? {});
  const facts: [string, string][] = [
    ...IDENTITY_FIELDS.filter((field) => card.identity[field]).map((field): [string, string] => [
      i18n._(IDENTITY_NAMES[field]),
      card.identity[field],
    ]),
    [t`Connection`, stateName(shown)],
    [t`Hours of operation`, decimal(card.hours, 1)],
    [t`Actions executed`, decimal(card.cycles)],
    [t`Counted since`, dateAndTime(card.counted_since)],
    ...counters.map(([name, value]): [string, string] => [words(translate({ text: name })), decimal(value)]),
    ...(counters.length > 0 ? [[t`Device counters read`, dateAndTime(card.seen)] as [string, string]] : []),
    ...(card.confirmed_at
      ? [[t`Confirmed`, `${dateAndTime(card.confirmed_at)}, ${card.confirmed_by ?? ""}`] as [string, string]]
      : []),
  ];
  return (
    <div className="device-card" tabIndex={0} role="group" aria-label={t`Card of ${card.name}`}>
      {card.found && (
        <div className="different" role="alert">
          <strong>{differenceOf(card)}</strong>
          <span>
            {technician
              ? t`It executes no commands until you confirm it.`
              : t`It executes no commands until a technician has confirmed it. Call a technician.`}
          </span>
          {technician && (
            <Button variant="primary" onPress={onReplace}>
              {t`Check and confirm…`}
            </Button>
          )}
        </div>
      )}
      {card.problem && (
        <p className="small error">
          {t`The identity could not be read: ${translate({ text: card.problem, key: card.key, values: card.values })}`}
        </p>
      )}
      <dl className="device-facts">
        {facts.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd data-name={value}>{value}</dd>
          </div>
        ))}
      </dl>
      {object && object.parameters.length > 0 && (
        <details>
          <summary>{t`Settings of the connection`}</summary>
          <dl className="device-facts">
            {object.parameters.map(({ name, value }) => (
              <div key={name}>
                <dt>{words(name)}</dt>
                <dd data-name={value}>{value.replace(/^"(.*)"$/, "$1")}</dd>
              </div>
            ))}
          </dl>
        </details>
      )}
      {technician && card.parameters && <Backups card={card} reload={reload} />}
      {object && technician && <Records id={card.object_id} />}
    </div>
  );
}
