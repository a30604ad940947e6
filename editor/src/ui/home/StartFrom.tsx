/** Choice of a template for a new scene or project; absent without templates. */

import { t } from "@lingui/core/macro";
import { useEditor } from "../../store/store";
import { isTemplate } from "./recent";

interface StartFromProps {
  of: readonly { id: string; name: string }[];
  value: string;
  onChange: (id: string) => void;
}

export function StartFrom({ of, value, onChange }: StartFromProps) {
  const state = useEditor((each) => each);
  const templates = of.filter(({ id }) => isTemplate(state, id));
  if (templates.length === 0) return null;
  return (
    <div className="field">
      <label htmlFor="start-from">{t`Start from`}</label>
      <select id="start-from" value={value} onChange={(event) => onChange(event.target.value)}>
        <option value="">{t`none`}</option>
        {templates.map(({ id, name }) => (
          <option key={id} value={id}>
            {t`a copy of ${name}`}
          </option>
        ))}
      </select>
    </div>
  );
}
