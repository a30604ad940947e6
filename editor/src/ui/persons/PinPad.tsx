/** The PIN pad. Keyboards write into it, too. The digits are never shown. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import { Button } from "../kit/kit";

const DIGITS = ["1", "2", "3", "4", "5", "6", "7", "8", "9"] as const;
const LONGEST = 12;

interface Props {
  busy: boolean;
  /** Whether the person has a PIN; without one, only the card works. */
  hasPin: boolean;
  /** Check a PIN; return whether it is correct. */
  onPin: (pin: string) => Promise<boolean>;
  onBack: () => void;
}

export function PinPad({ busy, hasPin, onPin, onBack }: Props) {
  const [pin, setPin] = useState("");
  const add = (digit: string) => setPin((before) => (before + digit).slice(0, LONGEST));
  const submit = () => {
    if (busy || pin.length < 4) return;
    void onPin(pin).then(() => setPin(""));
  };
  const latest = useRef({ submit, onBack });
  latest.current = { submit, onBack };
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      if (/^\d$/.test(event.key)) add(event.key);
      else if (event.key === "Backspace") setPin((before) => before.slice(0, -1));
      else if (event.key === "Escape") latest.current.onBack();
      else if (event.key === "Enter" && document.activeElement === document.body) latest.current.submit();
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  if (!hasPin)
    return (
      <div className="pin">
        <p>{t`This person logs on with a card. Hold it to the reader.`}</p>
        <Button icon="left" onPress={onBack}>{t`Back`}</Button>
      </div>
    );
  return (
    <div className="pin">
      <output className="pin-dots" aria-label={t`Digits entered: ${pin.length}`}>
        {"●".repeat(pin.length) || t`Enter your PIN`}
      </output>
      <div className="pin-keys">
        {DIGITS.map((each) => (
          <Button key={each} isDisabled={busy} onPress={() => add(each)}>
            {each}
          </Button>
        ))}
        <Button icon="close" aria-label={t`Delete digit`} isDisabled={busy} onPress={() => setPin(pin.slice(0, -1))} />
        <Button isDisabled={busy} onPress={() => add("0")}>
          0
        </Button>
        <Button
          variant="primary"
          icon="check"
          aria-label={t`Log on`}
          isDisabled={busy || pin.length < 4}
          onPress={submit}
        />
      </div>
      <Button icon="left" onPress={onBack}>{t`Back`}</Button>
    </div>
  );
}
