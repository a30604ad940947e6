/** A number pad for fingers, with units and relative changes; the keyboard writes into the same field. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useId, useState } from "react";
import { ANGLE_UNITS, amountText, isAngle, LENGTH_UNITS, parseAmount, type Unit } from "../../transform/amounts";
import { Button } from "../kit/kit";
import { PadKeys } from "../kit/PadKeys";

interface NumberPadProps {
  label: string;
  /** Value, m or rad. */
  value: number;
  unit: Unit;
  /** Whether the number is relative. */
  by: boolean;
  /** Only relative changes are possible. */
  onlyBy?: boolean;
  onUnit: (unit: Unit) => void;
  onBy: (by: boolean) => void;
  onDone: (value: number) => void;
  onClose: () => void;
}

export function NumberPad({ label, value, unit, by, onlyBy = false, onUnit, onBy, onDone, onClose }: NumberPadProps) {
  const id = useId();
  const change = by || onlyBy;
  const [text, setText] = useState("");
  const next = text.trim() === "" ? null : parseAmount(text, value, unit, change);
  const wrong = text.trim() !== "" && next === null;
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (next === null) return;
    onDone(next);
    onClose();
  };
  return (
    <form className="pad" onSubmit={submit} aria-label={t`Type ${label}`}>
      <div className="pad-head">
        <label htmlFor={id}>{change ? t`${label} by` : t`${label} to`}</label>
        <output className="quiet small" aria-live="polite">
          {wrong
            ? t`Enter a number.`
            : `${amountText(value, unit)} → ${next === null ? "…" : amountText(next, unit)} ${unit}`}
        </output>
      </div>
      <div className="pad-field">
        <input
          id={id}
          // The on-screen keyboard of the system would cover the item.
          inputMode="none"
          autoComplete="off"
          autoFocus
          placeholder={change ? "0" : amountText(value, unit)}
          value={text}
          aria-invalid={wrong}
          onChange={(event) => setText(event.target.value)}
          onKeyDown={(event) => {
            if (event.key === "Escape") onClose();
          }}
        />
        <Button aria-label={t`Delete the last character`} onPress={() => setText(text.slice(0, -1))}>
          ⌫
        </Button>
      </div>
      <PadKeys onKey={(key) => setText(text + key)}>
        <Button className="pad-key" excludeFromTabOrder aria-label={t`plus`} onPress={() => setText(`${text}+`)}>
          +
        </Button>
        {(isAngle(unit) ? ANGLE_UNITS : LENGTH_UNITS).map((each) => (
          <Button
            key={each}
            className="pad-key"
            excludeFromTabOrder
            aria-pressed={each === unit}
            aria-label={t`in ${each}`}
            onPress={() => onUnit(each)}
          >
            {each}
          </Button>
        ))}
      </PadKeys>
      <div className="actions">
        {!onlyBy && (
          <Button aria-pressed={change} onPress={() => onBy(!by)}>
            {t`Change by`}
          </Button>
        )}
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" type="submit" isDisabled={next === null}>
          {t`Set`}
        </Button>
      </div>
    </form>
  );
}
