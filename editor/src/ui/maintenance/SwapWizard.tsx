/** Steps of a technician after a device was replaced: identity, parameters, calibrations, confirmation. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { type CalibrationRecord, recordsOf } from "../../commands/calibrate";
import { differenceOf, IDENTITY_FIELDS, isOtherUnit } from "../../commands/maintenance";
import { refusal } from "../../commands/requests";
import { dateAndTime } from "../../formats";
import type { DeviceCard } from "../../protocol/types";
import { call } from "../../session/connection";
import { select, setUi, useEditor } from "../../store/store";
import { Records } from "../calibrate/Records";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { IDENTITY_NAMES } from "./Card";
import { Restore } from "./Restore";

interface Props {
  card: DeviceCard;
  reload: () => Promise<void>;
  onClose: () => void;
  /** Close the device cards, too. */
  onLeave: () => void;
}

const LAST = 3;

export function SwapWizard({ card: given, reload, onClose, onLeave }: Props) {
  // The confirmed card has no other identity, and is still shown at the end.
  const [card] = useState(given);
  const [step, setStep] = useState(0);
  const [confirmed, setConfirmed] = useState(false);
  const object = useEditor((state) => state.doc?.objects[card.object_id]);
  const inScene = useEditor((state) => state.doc !== null && state.doc.project === null);
  const { refused, busy, ask } = useRefusal();
  const [measured, setMeasured] = useState<CalibrationRecord[] | null>(null);
  useEffect(() => {
    recordsOf(card.object_id).then(setMeasured, () => setMeasured([]));
  }, [card.object_id]);
  const { found, identity } = card;
  const backup = card.backups[0];
  const other = isOtherUnit(card);
  const steps = [t`Identity`, t`Parameters`, t`Calibrations`, t`Confirm`];
  if (!found) {
    return (
      <>
        <p>{t`The confirmed device is connected.`}</p>
        <div className="actions">
          <Button variant="primary" onPress={onClose}>
            {t`Close`}
          </Button>
        </div>
      </>
    );
  }
  const confirm = () =>
    ask(
      refusal(async () => {
        await call("ConfirmDevice", { object_id: card.object_id, identity: found });
        setConfirmed(true);
        await reload();
      }),
    );
  const calibrate = () => {
    select({ kind: "object", id: card.object_id });
    setUi({ tool: "" });
    onLeave();
  };
  return (
    <div className="swap">
      <ol className="swap-steps">
        {steps.map((each, n) => (
          <li key={each} aria-current={n === step ? "step" : undefined}>
            {each}
          </li>
        ))}
      </ol>
      <div className="swap-body" tabIndex={0} role="group" aria-label={steps[step] ?? ""}>
        {step === 0 && (
          <>
            <p>{differenceOf(card)}</p>
            <div className="restore">
              <table>
                <thead>
                  <tr>
                    <td />
                    <th scope="col">{t`Until now`}</th>
                    <th scope="col">{t`Connected now`}</th>
                  </tr>
                </thead>
                <tbody>
                  {IDENTITY_FIELDS.filter((field) => identity[field] || found[field]).map((field) => (
                    <tr key={field} data-differs={card.differing.includes(field)}>
                      <th scope="row">{i18n._(IDENTITY_NAMES[field])}</th>
                      <td data-name={identity[field]}>{identity[field] || "–"}</td>
                      <td data-name={found[field]}>{found[field] || "–"}</td>
                    </tr>
                  ))}
                </tbody>
              </table>
            </div>
            <p className="quiet small">
              {t`Compare the serial number with the label on the device. If it is the wrong one, exchange it now.`}
            </p>
          </>
        )}
        {step === 1 && backup && (
          <>
            <p>{t`The last backup is of ${dateAndTime(backup.at)}, serial number ${backup.identity.serial || "–"}.`}</p>
            <Restore card={card} backup={backup} />
          </>
        )}
        {step === 1 && !backup && (
          <p>
            {card.parameters
              ? t`There is no backup of the parameters. Set the device up by hand.`
              : t`The driver does not transfer parameters of this device. Set it up as its manual says.`}
          </p>
        )}
        {step === 2 && (
          <>
            <p>
              {!other
                ? t`Same device. Its calibrations are valid; check them if the firmware changes its kinematics.`
                : measured?.length === 0
                  ? t`No calibration of the previous device is recorded.`
                  : t`These calibrations of the previous device are no longer valid. Measure them again.`}
            </p>
            {measured && measured.length > 0 && <Records id={card.object_id} />}
            {other && object && measured && measured.length > 0 && (
              <p className="quiet small">
                {inScene
                  ? t`Confirm the device first if it has to move for the calibration.`
                  : t`Open the scene to calibrate it.`}
              </p>
            )}
          </>
        )}
        {step === LAST &&
          (confirmed ? (
            <p role="status">{t`${card.name} is confirmed and executes commands again.`}</p>
          ) : (
            <>
              <p>{differenceOf(card)}</p>
              <p>
                {other
                  ? t`After that, programs and users can command it. Hours and actions are counted from zero.`
                  : t`After that, programs and users can command it.`}
              </p>
            </>
          ))}
      </div>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        {confirmed ? (
          <>
            {other && object && inScene && measured && measured.length > 0 && (
              <Button onPress={calibrate}>{t`Open calibration`}</Button>
            )}
            <Button variant="primary" onPress={onClose}>
              {t`Close`}
            </Button>
          </>
        ) : (
          <>
            <Button onPress={step === 0 ? onClose : () => setStep(step - 1)}>{step === 0 ? t`Cancel` : t`Back`}</Button>
            {step < LAST ? (
              <Button variant="primary" onPress={() => setStep(step + 1)}>
                {t`Next`}
              </Button>
            ) : (
              <Button variant="primary" isDisabled={busy} onPress={() => void confirm()}>
                {t`Confirm this device`}
              </Button>
            )}
          </>
        )}
      </div>
    </div>
  );
}
