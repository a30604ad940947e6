/** The fields of one condition: device, observation, and the value that is compared. */

import { t } from "@lingui/core/macro";
import { isNumber, needFor } from "../../commands/interlocks";
import { words } from "../../program/naming";
import type { Need, ObservationMeta, Operator, SceneObject } from "../../protocol/types";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { NumberField, SelectField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";

interface Props {
  need: Need;
  /** Objects with values that can be compared. */
  observed: readonly SceneObject[];
  onChange: (need: Need) => void;
  onRemove: () => void;
}

export function NeedFields({ need, observed, onChange, onRemove }: Props) {
  const types = useEditor((state) => state.types.byName);
  const values = useEditor((state) => state.live.values[need.object_id]?.values);
  const typeOf = (id: string) => types[observed.find((each) => each.id === id)?.type ?? ""];
  const observations = typeOf(need.object_id)?.observations ?? [];
  const observation = observations.find((each) => each.name === need.observation);
  const points = Object.keys(values ?? {});
  return (
    <div className="need">
      <SelectField
        label={t`Device`}
        value={need.object_id}
        choices={observed.map((each): [string, string] => [each.id ?? "", each.name])}
        onChange={(id) => onChange(needFor(id, typeOf(id)?.observations?.[0]))}
      />
      <SelectField
        label={t`Value`}
        value={need.observation}
        choices={observations.map((each): [string, string] => [each.name, words(each.name)])}
        onChange={(name) =>
          onChange(
            needFor(
              need.object_id,
              observations.find((each) => each.name === name),
              need.point,
            ),
          )
        }
      />
      {observation?.of_point &&
        (points.length > 0 ? (
          <SelectField
            label={t`Point`}
            value={need.point ?? ""}
            choices={[
              ["", t`Select…`],
              ...[...new Set([...points, need.point ?? ""])]
                .filter(Boolean)
                .map((each): [string, string] => [each, each]),
            ]}
            onChange={(point) => onChange({ ...need, point })}
          />
        ) : (
          <Field label={t`Point`} value={need.point ?? ""} onChange={(point) => onChange({ ...need, point })} />
        ))}
      <Compared need={need} observation={observation} onChange={onChange} />
      <Button onPress={onRemove}>{t`Remove condition`}</Button>
    </div>
  );
}

interface ComparedProps {
  need: Need;
  observation: ObservationMeta | undefined;
  onChange: (need: Need) => void;
}

function Compared({ need, observation, onChange }: ComparedProps) {
  const value = need.value ?? "true";
  if (observation?.members)
    return (
      <SelectField
        label={t`Must be`}
        value={value}
        choices={observation.members.map((each): [string, string] => [each, words(each.replaceAll('"', ""))])}
        onChange={(chosen) => onChange({ ...need, operator: "==", value: chosen })}
      />
    );
  if (isNumber(observation)) return <Limits need={need} unit={observation?.unit ?? ""} onChange={onChange} />;
  if (observation?.type === "string")
    return (
      <Field
        label={t`Must be`}
        value={JSON.parse(value)}
        onChange={(text) => onChange({ ...need, value: JSON.stringify(text) })}
      />
    );
  return (
    <ToggleGroup
      label={t`Must be`}
      value={value}
      choices={[
        ["true", t`Yes`],
        ["false", t`No`],
      ]}
      onChange={(chosen) => onChange({ ...need, operator: "==", value: chosen })}
    />
  );
}

function Limits({ need, unit, onChange }: { need: Need; unit: string; onChange: (need: Need) => void }) {
  const range = need.upper !== undefined;
  const upper = Number(need.upper ?? need.value ?? 0);
  const choose = (operator: Operator | "[]") => {
    const { upper: _, ...rest } = need;
    onChange(operator === "[]" ? { ...rest, operator, upper: String(upper + 1) } : { ...rest, operator });
  };
  return (
    <>
      <ToggleGroup
        label={t`Must be`}
        value={range ? "[]" : need.operator === ">=" ? ">=" : "<="}
        choices={[
          ["<=", t`At most`],
          [">=", t`At least`],
          ["[]", t`Between`],
        ]}
        onChange={choose}
      />
      <NumberField
        label={range ? t`From` : t`Limit`}
        unit={unit}
        digits={3}
        value={Number(need.value ?? 0)}
        onChange={(value) => onChange({ ...need, value: String(value) })}
      />
      {range && (
        <NumberField
          label={t`To`}
          unit={unit}
          digits={3}
          value={upper}
          onChange={(value) => onChange({ ...need, upper: String(value) })}
        />
      )}
    </>
  );
}
