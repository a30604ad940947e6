/** A number pad below the field of a value, for tablets on which the keys of the system are too small. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { Button } from "../kit/kit";
import { PadKeys } from "../kit/PadKeys";

interface ValuePadProps {
  label: string;
  text: string;
  onTyped: (text: string) => void;
  onSet: () => void;
  onCancel: () => void;
}

export default function ValuePad({ label, text, onTyped, onSet, onCancel }: ValuePadProps) {
  /** The first digit replaces the present value. */
  const [fresh, setFresh] = useState(true);
  const put = (next: string) => {
    setFresh(false);
    onTyped(next);
  };
  return (
    <div className="pad" role="group" aria-label={t`Type ${label}`}>
      <PadKeys onKey={(key) => put(fresh ? key : text + key)}>
        <Button
          className="pad-key pad-delete"
          excludeFromTabOrder
          aria-label={t`Delete the last character`}
          onPress={() => put(text.slice(0, -1))}
        >
          ⌫
        </Button>
      </PadKeys>
      <div className="actions">
        <Button onPress={onCancel}>{t`Cancel`}</Button>
        <Button variant="primary" onPress={onSet}>{t`Set`}</Button>
      </div>
    </div>
  );
}
