/** A name that is edited in place: saved on Enter or when the field loses the focus. */

import { useId, useState } from "react";
import { RefusedText, useRefusal } from "./Refusal";

export function NameField({
  label,
  name,
  why,
  onRename,
}: {
  label: string;
  name: string;
  why: string;
  onRename: (name: string) => Promise<string>;
}) {
  const id = useId();
  const [text, setText] = useState<string | null>(null);
  const { refused, busy, ask } = useRefusal();
  const commit = () => {
    const wanted = (text ?? name).trim().replaceAll(" ", "_");
    if (text === null) return;
    if (wanted === name || wanted === "") setText(null);
    else void ask(onRename(wanted)).then((done) => done && setText(null));
  };
  return (
    <div className="field name-field">
      <label htmlFor={id} className="hidden-but-read">
        {label}
      </label>
      <input
        id={id}
        value={text ?? name}
        autoComplete="off"
        disabled={busy}
        readOnly={why !== ""}
        title={why}
        aria-invalid={refused !== ""}
        onChange={(event) => setText(event.target.value)}
        onBlur={commit}
        onKeyDown={(event) => {
          if (event.key === "Enter") commit();
          if (event.key === "Escape") setText(null);
        }}
      />
      <RefusedText>{refused}</RefusedText>
    </div>
  );
}
