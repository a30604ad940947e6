/**
 * The field of a value by its type. Typed values are sent on Enter or when the field loses the focus, choices at once.
 * An invalid or refused value stays in the field with the reason below.
 */

import { t } from "@lingui/core/macro";
import type { ReactNode } from "react";
import { Suspense, useEffect, useId, useState } from "react";
import { decimal } from "../../formats";
import { words } from "../../program/naming";
import { type Extra, parseValue, rangeWords, shownUnit, textOf, withoutUnit } from "../../program/values";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import "./value.css";

/** Nine keys, as dots. */
const KEYPAD = "M5 5h0M12 5h0M19 5h0M5 12h0M12 12h0M19 12h0M5 19h0M12 19h0M19 19h0";
const ValuePad = lazyComponent(() => import("./ValuePad"));

export interface Choice {
  /** JSON of the value. */
  json: string;
  label: string;
}

interface ValueFieldProps {
  label: ReactNode;
  /** Context for screen readers. */
  name: string;
  type: string;
  json: string | undefined;
  extra?: Extra;
  /** Choices of a list. */
  choices?: Choice[];
  hint?: string;
  /** A secret value: the server sends a placeholder for it. */
  secret?: boolean;
  /** The reason why it cannot be changed; empty if it can be changed. */
  why?: string;
  /** It must be entered: marked, and empty while it has its default value, which means "not set". */
  required?: boolean;
  autoFocus?: boolean;
  /** Called for each typed text that is a valid value, so that it is not lost when the form is closed. */
  onTyped?: (json: string) => void;
  /** Send the value; return why it was refused. */
  onSet: (json: string) => Promise<string>;
  children?: ReactNode;
}

export function ValueField({
  label,
  name,
  type,
  json,
  extra = {},
  choices,
  hint,
  secret = false,
  why = "",
  required = false,
  autoFocus = false,
  onTyped,
  onSet,
  children,
}: ValueFieldProps) {
  const stored = secret && (json ?? "").startsWith('"***');
  const known = stored ? "" : textOf(type, json, extra);
  const [text, setText] = useState(known);
  const [problem, setProblem] = useState("");
  const [padOpen, setPadOpen] = useState(false);
  const id = useId();
  // The value was changed by another user, or accepted. A text that means the same stays as it is typed.
  useEffect(() => {
    setText((typed) => {
      const found = parseValue(type, typed, extra);
      return "json" in found && found.json === json ? typed : known;
    });
    setProblem("");
  }, [known]);

  const set = async (next: string) => {
    if (next === json) return setProblem("");
    setProblem(await onSet(next));
  };
  const leave = () => {
    if (text === known) return setProblem("");
    const found = parseValue(type, text, extra);
    if ("problem" in found) setProblem(found.problem);
    else void set(found.json);
  };
  const takeTyped = (typed: string) => {
    setText(typed);
    const found = onTyped && parseValue(type, typed, extra);
    if (found && "json" in found) onTyped(found.json);
  };
  const reset = () => {
    setText(known);
    setProblem("");
  };
  const isNumber = type === "integer" || type === "double";
  const range = rangeWords(type, extra);
  const [unit] = shownUnit(type, extra);
  const about = [hint && withoutUnit(hint, type, extra), range].filter(Boolean).join(" · ");
  const described = {
    id,
    "aria-invalid": problem !== "" || undefined,
    "aria-describedby": `${id}-about`,
    "aria-required": required || undefined,
    disabled: why !== "",
  };
  const listed =
    choices ??
    (type === "boolean"
      ? booleans()
      : extra.allowed_values?.map((each) => ({
          json: JSON.stringify(each),
          label: typeof each === "string" ? words(each) : decimal(each),
        })));
  return (
    <div className="field value-field">
      <div className="value-head">
        <label htmlFor={id}>{label}</label>
        {required && <span className="tag" aria-hidden="true">{t`required`}</span>}
        {children}
      </div>
      {listed && listed.length <= 3 && listed.every((each) => each.label.length <= 9) ? (
        <div className="chips" role="radiogroup" aria-label={name} id={id}>
          {listed.map((each) => (
            <label key={each.json} className="chip" data-selected={each.json === json}>
              <input
                type="radio"
                className="hidden-but-read"
                name={id}
                checked={each.json === json}
                disabled={why !== ""}
                onChange={() => void set(each.json)}
              />
              {each.label}
            </label>
          ))}
        </div>
      ) : listed ? (
        <select {...described} value={json ?? ""} onChange={(event) => void set(event.target.value)}>
          {!listed.some((each) => each.json === json) && (
            <option value={json ?? ""}>{known ? t`${known} (not in the list)` : t`choose…`}</option>
          )}
          {listed.map((each) => (
            <option key={each.json} value={each.json}>
              {each.label}
            </option>
          ))}
        </select>
      ) : (
        <>
          <span className="with-unit">
            <input
              {...described}
              value={text}
              inputMode={isNumber ? "decimal" : undefined}
              type={secret ? "password" : undefined}
              placeholder={stored ? t`Stored. Type to replace it.` : undefined}
              autoComplete={secret ? "new-password" : "off"}
              autoFocus={autoFocus}
              onChange={(event) => takeTyped(event.target.value)}
              onBlur={leave}
              onKeyDown={(event) => {
                if (event.key === "Enter") leave();
                if (event.key === "Escape" && text !== known) {
                  event.stopPropagation();
                  reset();
                }
              }}
            />
            {unit && <span className="unit quiet">{unit}</span>}
            {isNumber && !why && (
              <Button
                className="pad-open"
                aria-label={t`Number pad for ${name}`}
                aria-expanded={padOpen}
                onPress={() => setPadOpen(!padOpen)}
              >
                <svg viewBox="0 0 24 24" width="20" aria-hidden="true">
                  <path d={KEYPAD} stroke="currentColor" strokeWidth="4" strokeLinecap="round" />
                </svg>
              </Button>
            )}
          </span>
          {padOpen && (
            <Suspense fallback={null}>
              <ValuePad
                label={name}
                text={text}
                onTyped={takeTyped}
                onSet={() => {
                  leave();
                  setPadOpen(false);
                }}
                onCancel={() => {
                  reset();
                  setPadOpen(false);
                }}
              />
            </Suspense>
          )}
        </>
      )}
      <span id={`${id}-about`} className="quiet small about-value">
        {problem ? (
          <span className="error" role="alert">
            {problem}
          </span>
        ) : (
          why || about
        )}
      </span>
    </div>
  );
}

const booleans = (): Choice[] => [
  { json: "true", label: t`Yes` },
  { json: "false", label: t`No` },
];
