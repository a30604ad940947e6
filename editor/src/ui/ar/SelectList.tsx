/** A list that replaces the browser's list of a `<select>`, which is not shown over an XR session. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { ModalDialog } from "../kit/dialogs";
import { Button } from "../kit/kit";

export default function SelectList() {
  const [open, setOpen] = useState<HTMLSelectElement | null>(null);
  useEffect(() => {
    const press = (event: Event) => {
      const select = event.target instanceof Element ? event.target.closest("select") : null;
      if (!select || select.disabled) return;
      event.preventDefault();
      setOpen(select);
    };
    document.addEventListener("mousedown", press, { capture: true });
    return () => document.removeEventListener("mousedown", press, { capture: true });
  }, []);
  if (!open) return null;
  const choose = (value: string) => {
    setOpen(null);
    open.value = value;
    open.dispatchEvent(new Event("change", { bubbles: true }));
  };
  return (
    <ModalDialog title={open.labels[0]?.textContent || open.ariaLabel || t`Choose`} onClose={() => setOpen(null)}>
      <div className="ar-choices">
        {[...open.options].map((each) => (
          <Button
            key={each.value}
            isDisabled={each.disabled}
            aria-pressed={each.selected}
            variant={each.selected ? "primary" : ""}
            onPress={() => choose(each.value)}
          >
            {each.text}
          </Button>
        ))}
      </div>
    </ModalDialog>
  );
}
