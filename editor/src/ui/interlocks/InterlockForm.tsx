/** The form of an interlock: its target, its conditions, and the reaction while one is not met. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { canBeZone, needFor, putInterlock } from "../../commands/interlocks";
import { byName } from "../../formats";
import { words } from "../../program/naming";
import type { Interlock, Need, Position, SceneObject } from "../../protocol/types";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { NumberField, SelectField, SwitchField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { NeedFields } from "./NeedFields";

/** Longest time for which an action waits, s. */
const MAX_WAIT = 3600;

export function InterlockForm({ interlock, onDone }: { interlock: Interlock; onDone: () => void }) {
  const [draft, setDraft] = useState(interlock);
  const { refused, busy, ask } = useRefusal();
  const objects = useEditor((state) => state.doc?.objects);
  const types = useEditor((state) => state.types);
  const all = Object.values(objects ?? {}).sort(byName);
  const zone = draft.on === "zone";
  const bodies = all.filter((each) => canBeZone(types.byName[each.type]));
  const devices = all.filter((each) => (types.actions[each.type]?.length ?? 0) > 0);
  const observed = all.filter((each) => types.byName[each.type]?.observations);
  const change = (fields: Partial<Interlock>) => setDraft((known) => ({ ...known, ...fields }));
  const changeNeed = (at: number, need: Need) =>
    change({ needs: draft.needs.map((each, n) => (n === at ? need : each)) });
  const target = objects?.[draft.object_id];
  const save = async () => {
    if (await ask(putInterlock(draft))) onDone();
  };
  const addNeed = () => {
    const [first] = observed;
    if (first) change({ needs: [...draft.needs, needFor(first.id, types.byName[first.type]?.observations?.[0])] });
  };
  return (
    <>
      <div className="interlock-form">
        <Field label={t`Name`} value={draft.name} onChange={(name) => change({ name })} maxLength={200} />
        <ToggleGroup
          label={t`Applies to`}
          value={draft.on}
          choices={[
            ["zone", t`A zone`],
            ["action", t`Actions of a device`],
          ]}
          onChange={(on) => change({ on, object_id: "", actions: [], retract: [] })}
        />
        <SelectField
          label={zone ? t`Body of the zone` : t`Device`}
          value={draft.object_id}
          choices={choicesOf(zone ? bodies : devices)}
          onChange={(object_id) => change({ object_id, actions: [] })}
        />
        {zone && (
          <p className="quiet small">
            {bodies.length > 0
              ? t`One robot at a time may be in it. Make it as large as the part of the robot that enters.`
              : t`Add a box, a cylinder or a sphere to the scene first.`}
          </p>
        )}
        {zone && target && <RetractPath path={draft.retract ?? []} onChange={(retract) => change({ retract })} />}
        {!zone && target && (
          <Actions
            draft={draft}
            names={(types.actions[target.type] ?? []).map((each) => each.name)}
            onChange={change}
          />
        )}
        <fieldset>
          <legend>{t`Conditions`}</legend>
          {draft.needs.map((need, n) => (
            <NeedFields
              key={n}
              need={need}
              observed={observed}
              onChange={(changed) => changeNeed(n, changed)}
              onRemove={() => change({ needs: draft.needs.filter((_, at) => at !== n) })}
            />
          ))}
          <Button
            icon="plus"
            why={observed.length > 0 ? "" : t`No device of the scene has values that can be compared.`}
            onPress={addNeed}
          >
            {t`Add condition`}
          </Button>
        </fieldset>
        {draft.needs.length > 0 && (
          <SwitchField isSelected={draft.during} onChange={(during) => change({ during })}>
            {zone ? t`Needed as long as a robot moves in the zone` : t`Needed until the action has ended`}
          </SwitchField>
        )}
        <ToggleGroup
          label={t`While it is not met`}
          value={draft.else}
          choices={[
            ["wait", t`Wait, then hold`],
            ["hold", t`Hold at once`],
          ]}
          onChange={(value) => change({ else: value })}
        />
        {draft.else === "wait" && (
          <NumberField
            label={t`Wait at most`}
            unit="s"
            value={draft.within}
            digits={0}
            least={0}
            most={MAX_WAIT}
            step={5}
            onChange={(within) => change({ within })}
          />
        )}
      </div>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button onPress={onDone}>{t`Cancel`}</Button>
        <Button
          variant="primary"
          isDisabled={busy}
          why={draft.object_id ? "" : zone ? t`Select the body of the zone first.` : t`Select the device first.`}
          onPress={() => void save()}
        >
          {t`Save`}
        </Button>
      </div>
    </>
  );
}

/** Return the objects as choices, with a prompt for none. */
const choicesOf = (objects: readonly SceneObject[]): [string, string][] => [
  ["", t`Select…`],
  ...objects.map((each): [string, string] => [each.id ?? "", each.name]),
];

interface RetractPathProps {
  path: readonly Position[];
  onChange: (path: Position[]) => void;
}

/** The path on which a robot leaves the zone. */
function RetractPath({ path, onChange }: RetractPathProps) {
  return (
    <fieldset>
      <legend>{t`Retract path`}</legend>
      <p className="quiet small">
        {path.length > 0
          ? t`Points in the frame of the body, from inside to outside. A robot that may not stay leaves on this path.`
          : t`A robot that may not stay in the zone leaves it by the shortest path.`}
      </p>
      {path.map((point, n) => (
        <div key={n} className="need">
          {(["x", "y", "z"] as const).map((axis) => (
            <NumberField
              key={axis}
              label={`${n + 1} ${axis.toUpperCase()}`}
              unit="mm"
              digits={0}
              value={point[axis] * 1000}
              onChange={(value) =>
                onChange(path.map((each, at) => (at === n ? { ...each, [axis]: value / 1000 } : each)))
              }
            />
          ))}
          <Button onPress={() => onChange(path.filter((_, at) => at !== n))}>{t`Remove point`}</Button>
        </div>
      ))}
      <Button icon="plus" onPress={() => onChange([...path, path.at(-1) ?? { x: 0, y: 0, z: 0 }])}>
        {t`Add point`}
      </Button>
    </fieldset>
  );
}

interface ActionsProps {
  draft: Interlock;
  names: readonly string[];
  onChange: (fields: Partial<Interlock>) => void;
}

/** All actions, or some of them. */
function Actions({ draft, names, onChange }: ActionsProps) {
  const [some, setSome] = useState(draft.actions.length > 0);
  return (
    <>
      <ToggleGroup
        label={t`Actions`}
        value={some ? "some" : "all"}
        choices={[
          ["all", t`All, also jogging`],
          ["some", t`Some`],
        ]}
        onChange={(which) => {
          setSome(which === "some");
          if (which === "all") onChange({ actions: [] });
        }}
      />
      {some &&
        names.map((each) => (
          <SwitchField
            key={each}
            isSelected={draft.actions.includes(each)}
            onChange={(on) =>
              onChange({ actions: on ? [...draft.actions, each] : draft.actions.filter((one) => one !== each) })
            }
          >
            {words(each)}
          </SwitchField>
        ))}
    </>
  );
}
