/** The keys of a number pad for fingers, also in gloves. */

import { t } from "@lingui/core/macro";
import type { ReactNode } from "react";
import { decimalPoint } from "../../formats";
import { Button } from "./kit";
import "./pad.css";

const KEYS = ["7", "8", "9", "4", "5", "6", "1", "2", "3", "0", ".", "−"] as const;

/** `onKey` receives the character of a key. More keys are its children. */
export function PadKeys({ onKey, children }: { onKey: (character: string) => void; children?: ReactNode }) {
  return (
    <div className="pad-keys">
      {KEYS.map((key) => (
        <Button
          key={key}
          className="pad-key"
          excludeFromTabOrder
          aria-label={key === "−" ? t`minus` : key === "." ? t`decimal point` : key}
          onPress={() => onKey(key === "−" ? "-" : key === "." ? decimalPoint() : key)}
        >
          {key === "." ? decimalPoint() : key}
        </Button>
      ))}
      {children}
    </div>
  );
}
