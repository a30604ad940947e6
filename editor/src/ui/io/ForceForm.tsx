/** Choose the value to which an output is forced. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { forcePoint } from "../../commands/forces";
import { refusal } from "../../commands/requests";
import { numberFrom } from "../../formats";
import { shownUnit } from "../../program/values";
import type { LivePoint } from "../../protocol/types";
import { ModalDialog } from "../kit/dialogs";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { valueText } from "./points";

interface Props {
  objectId: string;
  device: string;
  point: LivePoint;
  onClose: () => void;
}

export function ForceForm({ objectId, device, point, onClose }: Props) {
  const { refused, busy, ask } = useRefusal();
  const [text, setText] = useState("");
  const output = `${device}: ${point.name}`;
  const [unit, factor] = shownUnit("double", { unit: point.unit });
  const number = numberFrom(text) / factor;
  const present = valueText(point.value, point.unit);
  const force = async (value: boolean | number) => {
    const work = () => forcePoint({ object_id: objectId, point: point.name, value });
    if (await ask(refusal(work))) onClose();
  };
  return (
    <ModalDialog title={t`Force ${output}`} onClose={onClose}>
      <p>{t`It is ${present} now. The device acts at once. Make sure that nobody is in danger.`}</p>
      <p className="quiet small">
        {t`The force ends when you end it, log off, or this device loses its connection.`}{" "}
        {t`The output then returns to its previous value. Until then, no program can start.`}{" "}
        {t`This is not a safety function.`}
      </p>
      {point.force === "analog" && (
        <Field
          label={unit ? t`Value, ${unit}` : t`Value`}
          value={text}
          onChange={setText}
          autoFocus
          inputMode="decimal"
        />
      )}
      <RefusedText>{refused}</RefusedText>
      <div className="actions io-force">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        {point.force === "analog" ? (
          <Button variant="danger" isDisabled={busy || !Number.isFinite(number)} onPress={() => void force(number)}>
            {t`Force`}
          </Button>
        ) : (
          [false, true].map((value) => (
            <Button key={String(value)} variant="danger" isDisabled={busy} onPress={() => void force(value)}>
              {value ? t`Force on` : t`Force off`}
            </Button>
          ))
        )}
      </div>
    </ModalDialog>
  );
}
