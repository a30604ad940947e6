/** Fields of the settings of an object: required ones first and marked, groups and advanced ones below. */

import { t } from "@lingui/core/macro";
import { Fragment } from "react";
import { words } from "../../program/naming";
import { grouped, type Values } from "../../program/settings";
import { extraOf, nameWithoutUnit } from "../../program/values";
import type { ObjectTypeMeta, ParameterMeta } from "../../protocol/types";
import { ValueField } from "../program/ValueField";
import { FindDevices } from "./FindDevices";

interface SettingsFieldsProps {
  type: ObjectTypeMeta;
  values: Values;
  why: string;
  /** Focus the first required field. */
  autoFocus?: boolean;
  onChange: (values: Values) => void;
}

export function SettingsFields({ type: owner, values, why, autoFocus = false, onChange }: SettingsFieldsProps) {
  const { settings } = owner;
  const needed = settings.filter((each) => each.default_value === undefined || each.for_control);
  // The port belongs to the address.
  const first = [...needed, ...settings.filter((each) => each.name === "port" && !needed.includes(each))];
  const groups = grouped(settings.filter((each) => !first.includes(each)));
  const set = (name: string, json: string, initial: string | undefined) => {
    const next = { ...values, [name]: json };
    if (json === initial) delete next[name];
    onChange(next);
  };
  const field = (each: ParameterMeta) => {
    const { name, type, default_value, for_control } = each;
    const extra = extraOf(each);
    const label = words(nameWithoutUnit(name, extra));
    const control = (
      <ValueField
        key={name}
        label={label}
        name={label}
        type={type}
        json={values[name] ?? (for_control ? undefined : default_value)}
        extra={extra}
        hint={each.description}
        secret={each.secret}
        why={why}
        required={needed.includes(each)}
        autoFocus={autoFocus && each === needed[0]}
        onTyped={each.secret ? undefined : (json) => set(name, json, default_value)}
        onSet={(json) => {
          set(name, json, default_value);
          return Promise.resolve("");
        }}
      />
    );
    if (!each.found_by || why) return control;
    return (
      <Fragment key={name}>
        {control}
        <FindDevices type={owner} setting={each} values={values} onFound={(json) => set(name, json, default_value)} />
      </Fragment>
    );
  };
  return (
    <>
      {first.map(field)}
      {groups.map(({ title, settings: members }) => (
        <details
          key={title}
          className="more-settings"
          open={first.length === 0 && groups.length === 1 && members.length <= 6}
        >
          <summary>
            {title ? titleOf(title) : first.length > 0 ? t`Advanced` : t`Settings`}{" "}
            <span className="tag">{members.length}</span>
          </summary>
          {members.map(field)}
        </details>
      ))}
    </>
  );
}

/** Return the title of a group; short words are abbreviations, such as TCP. */
function titleOf(word: string): string {
  const title = words(word);
  return title.length <= 3 ? title.toUpperCase() : title.charAt(0).toUpperCase() + title.slice(1);
}
