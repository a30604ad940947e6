/** The differences between a backup and the connected device, and restoring it. */

import { t } from "@lingui/core/macro";
import { useCallback, useEffect, useState } from "react";
import { refusal } from "../../commands/requests";
import { translate } from "../../i18n/serverMessages";
import type { BackupInfo, CompareParametersData, DeviceCard, RestoreParametersData } from "../../protocol/types";
import { call } from "../../session/connection";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

interface Props {
  card: DeviceCard;
  backup: BackupInfo;
}

export function Restore({ card, backup }: Props) {
  const [found, setFound] = useState<CompareParametersData | null>(null);
  const [done, setDone] = useState<RestoreParametersData | null>(null);
  const { refused, busy, ask } = useRefusal();
  const args = { object_id: card.object_id, backup_id: backup.id };
  const compare = useCallback(async () => setFound(await call("CompareParameters", args)), [card.object_id, backup.id]);
  useEffect(() => {
    void ask(refusal(compare));
  }, [compare]);
  const restore = () =>
    ask(
      refusal(async () => {
        setDone(await call("RestoreParameters", args));
        await compare();
      }),
    );
  const value = (each: boolean | number | string | undefined, unit: string) =>
    each === undefined ? "–" : `${each}${unit && ` ${unit}`}`;
  const changes = found?.differences ?? [];
  return (
    <div className="restore">
      {!found && !refused && <Waiting>{t`Reading the parameters…`}</Waiting>}
      {found && changes.length === 0 && (
        <p className="small">{t`All ${found.equal} parameters are as in the backup.`}</p>
      )}
      {changes.length > 0 && (
        <table>
          <thead>
            <tr>
              <th scope="col">{t`Parameter`}</th>
              <th scope="col">{t`Device`}</th>
              <th scope="col">{t`Backup`}</th>
            </tr>
          </thead>
          <tbody>
            {changes.map((each) => (
              <tr key={each.name}>
                <th scope="row" data-name={each.name}>
                  {each.name}
                </th>
                <td data-name={each.name}>{value(each.device, each.unit)}</td>
                <td data-name={each.name}>{value(each.backup, each.unit)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {done && (
        <div role="status">
          <p className="small">{t`${done.written} parameters written, ${done.failures.length} not.`}</p>
          <ul>
            {done.failures.map((each) => (
              <li key={each.name} className="small error">
                <span data-name={each.name}>{each.name}</span>:{" "}
                {translate({ text: each.reason, key: each.key, values: each.values })}
              </li>
            ))}
          </ul>
        </div>
      )}
      <RefusedText>{refused}</RefusedText>
      {card.restores && changes.some((each) => each.backup !== undefined) && (
        <Button variant="primary" isDisabled={busy} onPress={() => void restore()}>
          {t`Restore these values`}
        </Button>
      )}
    </div>
  );
}
