/** A text field in place of a name or description: Enter saves, Escape cancels. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

interface InlineProps {
  label: string;
  value: string;
  /** Existing names. */
  taken?: string[];
  many?: boolean;
  onSave: (value: string) => Promise<string>;
  onClose: () => void;
}

export function Inline({ label, value, taken = [], many = false, onSave, onClose }: InlineProps) {
  const [text, setText] = useState(value);
  const { refused, busy, ask } = useRefusal();
  const clean = text.trim();
  const problem = clean !== value && taken.includes(clean) ? t`This name is already in use.` : "";
  const save = (event?: FormEvent) => {
    event?.preventDefault();
    if (clean === value) return onClose();
    if (problem || (!many && !clean)) return;
    void ask(onSave(clean)).then((done) => done && onClose());
  };
  const shared = {
    "aria-label": label,
    "aria-invalid": (problem || refused) !== "" || undefined,
    value: text,
    autoFocus: true,
    autoComplete: "off",
    onKeyDown: (event: { key: string; ctrlKey: boolean }) => {
      if (event.key === "Escape") onClose();
      if (many && event.key === "Enter" && event.ctrlKey) save();
    },
  };
  return (
    <form className="field inline" onSubmit={save}>
      {many ? (
        <textarea rows={3} {...shared} onChange={(event) => setText(event.target.value)} />
      ) : (
        <input
          {...shared}
          onFocus={(event) => event.target.select()}
          onChange={(event) => setText(event.target.value)}
        />
      )}
      <RefusedText>{problem || refused}</RefusedText>
      <div className="actions">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" type="submit" isDisabled={busy || problem !== "" || (!many && !clean)}>
          {t`Save`}
        </Button>
      </div>
    </form>
  );
}
