/** Form fields in panels: toggle buttons, a select, a number with its unit, a slider, a switch. */

import { t } from "@lingui/core/macro";
import { type KeyboardEvent, type ReactNode, useId, useState } from "react";
import { Switch, ToggleButton, ToggleButtonGroup } from "react-aria-components";
import { fixed, normalised } from "../../formats";
import "./fields.css";

interface ToggleGroupProps<T extends string> {
  label: string;
  value: T;
  choices: readonly (readonly [T, ReactNode])[];
  onChange: (value: T) => void;
  /** The label is for screen readers only. */
  quiet?: boolean;
}

/** A choice of one of a few options, as toggle buttons next to each other. */
export function ToggleGroup<T extends string>({ label, value, choices, onChange, quiet = false }: ToggleGroupProps<T>) {
  const id = useId();
  return (
    <div className="one-of">
      <span id={id} className={quiet ? "hidden-but-read" : "one-of-label"}>
        {label}
      </span>
      <ToggleButtonGroup
        aria-labelledby={id}
        className="one-of-choices"
        selectionMode="single"
        disallowEmptySelection
        selectedKeys={[value]}
        onSelectionChange={(keys) => {
          const [next] = keys;
          if (next !== undefined) onChange(String(next) as T);
        }}
      >
        {choices.map(([key, words]) => (
          <ToggleButton key={key} id={key} className="button">
            {words}
          </ToggleButton>
        ))}
      </ToggleButtonGroup>
    </div>
  );
}

interface SelectFieldProps {
  label: string;
  value: string;
  choices: readonly (readonly [string, string])[];
  onChange: (value: string) => void;
  isDisabled?: boolean;
}

/** A choice of one of many options, as a native select. */
export function SelectField({ label, value, choices, onChange, isDisabled = false }: SelectFieldProps) {
  const id = useId();
  return (
    <div className="field">
      <label htmlFor={id}>{label}</label>
      <select id={id} value={value} disabled={isDisabled} onChange={(event) => onChange(event.target.value)}>
        {choices.map(([key, words]) => (
          <option key={key} value={key}>
            {words}
          </option>
        ))}
      </select>
    </div>
  );
}

interface NumberFieldProps {
  label: string;
  unit: string;
  value: number;
  /** Called on Enter, and when the field loses the focus. */
  onChange: (value: number) => void;
  digits?: number;
  least?: number;
  most?: number;
  /** Change by an arrow key. */
  step?: number;
  isDisabled?: boolean;
}

/** A number with its unit. `+5` adds to the present value, `-=5` subtracts; `-5` is that number. */
export function NumberField({
  label,
  unit,
  value,
  onChange,
  digits = 1,
  least = -Infinity,
  most = Infinity,
  step = 1,
  isDisabled = false,
}: NumberFieldProps) {
  const id = useId();
  const shown = fixed(value, digits);
  const [text, setText] = useState<string | null>(null);
  const [wrong, setWrong] = useState("");
  const give = (next: number) => {
    if (next < least || next > most) {
      setWrong(t`From ${fixed(least, digits)} to ${fixed(most, digits)} ${unit}.`);
      return;
    }
    setWrong("");
    setText(null);
    if (Math.abs(next - value) > 1e-9) onChange(next);
  };
  const commit = () => {
    if (text === null) return;
    const next = parsed(text, value);
    if (next === null) setWrong(t`Enter a number.`);
    else give(next);
  };
  const key = (event: KeyboardEvent) => {
    if (event.key === "Enter") commit();
    else if (event.key === "Escape") {
      setText(null);
      setWrong("");
    } else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      event.preventDefault();
      give(value + (event.key === "ArrowUp" ? step : -step));
    }
  };
  return (
    <div className="amount" data-wrong={wrong !== ""}>
      <label htmlFor={id}>
        {label} <span className="quiet">{unit}</span>
      </label>
      <input
        id={id}
        inputMode="decimal"
        autoComplete="off"
        value={text ?? shown}
        disabled={isDisabled}
        aria-invalid={wrong !== ""}
        aria-describedby={wrong ? `${id}-wrong` : undefined}
        onFocus={(event) => event.target.select()}
        onChange={(event) => setText(event.target.value)}
        onBlur={commit}
        onKeyDown={key}
      />
      {wrong && (
        <span id={`${id}-wrong`} className="amount-wrong" role="alert">
          {wrong}
        </span>
      )}
    </div>
  );
}

/** Return a typed number, or the present value with a typed change; null if it is invalid. */
export function parsed(text: string, value: number): number | null {
  const clean = normalised(text);
  const change = /^([+-])=?\s*(\d*\.?\d+)$/.exec(clean);
  if (change && (clean.startsWith("+") || clean.includes("=")))
    return value + (change[1] === "-" ? -1 : 1) * Number(change[2]);
  return clean !== "" && Number.isFinite(Number(clean)) ? Number(clean) : null;
}

interface SliderFieldProps {
  label: string;
  value: number;
  least: number;
  most: number;
  step: number;
  words: (value: number) => string;
  onChange: (value: number) => void;
  onEnd?: (value: number) => void;
}

export function SliderField({ label, value, least, most, step, words, onChange, onEnd }: SliderFieldProps) {
  const id = useId();
  const end = () => onEnd?.(value);
  return (
    <div className="more-or-less">
      <label htmlFor={id}>{label}</label>
      <output htmlFor={id}>{words(value)}</output>
      <input
        id={id}
        type="range"
        min={least}
        max={most}
        step={step}
        value={value}
        aria-valuetext={words(value)}
        onChange={(event) => onChange(Number(event.target.value))}
        onPointerUp={end}
        onKeyUp={end}
      />
    </div>
  );
}

export function SwitchField({
  children,
  isSelected,
  onChange,
}: {
  children: ReactNode;
  isSelected: boolean;
  onChange: (on: boolean) => void;
}) {
  return (
    <Switch className="on-off" isSelected={isSelected} onChange={onChange}>
      <span className="on-off-track" aria-hidden="true" />
      {children}
    </Switch>
  );
}
