/** Which results are shown: the period and the cell. */

import { t } from "@lingui/core/macro";
import { useId } from "react";
import { SelectField, ToggleGroup } from "../ui/kit/fields";
import { type Choice, dayOf, type Span } from "./results";

interface FiltersProps {
  choice: Choice;
  cells: readonly string[];
  onChange: (choice: Choice) => void;
}

export function Filters({ choice, cells, onChange }: FiltersProps) {
  const id = useId();
  const spans: [Span, string][] = [
    ["8", t`8 hours`],
    ["24", t`24 hours`],
    ["168", t`7 days`],
    ["day", t`Day`],
  ];
  return (
    <div className="fleet-filters">
      <ToggleGroup
        label={t`Period`}
        value={choice.span}
        choices={spans}
        onChange={(span) => onChange({ ...choice, span })}
      />
      {choice.span === "day" && (
        <div className="field">
          <label htmlFor={id}>{t`Day`}</label>
          <input
            id={id}
            type="date"
            value={choice.day}
            max={dayOf(Date.now())}
            onChange={({ target: { value } }) => value && onChange({ ...choice, day: value })}
          />
        </div>
      )}
      <SelectField
        label={t`Cell`}
        value={choice.cell}
        choices={[["", t`All cells`] as const, ...cells.map((name) => [name, name] as const)]}
        onChange={(cell) => onChange({ ...choice, cell })}
      />
    </div>
  );
}
