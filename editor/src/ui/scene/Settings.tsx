/** Fields of the settings of an object: required ones first, advanced ones below. */

import { t } from "@lingui/core/macro";
import { words } from "../../program/naming";
import { extraOf } from "../../program/values";
import type { Parameter, ParameterMeta } from "../../protocol/types";
import { ValueField } from "../program/ValueField";

/** JSON of each setting that differs from its default. */
export type Values = Record<string, string>;

/** Values in the format of the server. */
export function parametersOf(settings: ParameterMeta[], values: Values): Parameter[] {
  return settings.flatMap(({ name, type }) =>
    values[name] === undefined ? [] : [{ name, type, value: values[name] }],
  );
}

/** Names of required settings without a value. */
export function missing(settings: ParameterMeta[], values: Values): string[] {
  return settings
    .filter(
      ({ name, default_value }) => default_value === undefined && (values[name] === undefined || values[name] === '""'),
    )
    .map(({ name }) => name);
}

export function SettingsFields({
  settings,
  values,
  why,
  onChange,
}: {
  settings: ParameterMeta[];
  values: Values;
  why: string;
  onChange: (values: Values) => void;
}) {
  const needed = settings.filter((each) => each.default_value === undefined);
  const others = settings.filter((each) => each.default_value !== undefined);
  const field = (each: ParameterMeta) => (
    <ValueField
      key={each.name}
      label={words(each.name)}
      name={words(each.name)}
      type={each.type}
      json={values[each.name] ?? each.default_value}
      extra={extraOf(each)}
      hint={each.description}
      secret={each.secret}
      why={why}
      onSet={(json) => {
        const next = { ...values, [each.name]: json };
        if (json === each.default_value) delete next[each.name];
        onChange(next);
        return Promise.resolve("");
      }}
    />
  );
  return (
    <>
      {needed.map(field)}
      {others.length > 0 && (
        <details className="more-settings" open={needed.length === 0 && others.length <= 6}>
          <summary>
            {needed.length > 0 ? t`Advanced` : t`Settings`} <span className="tag">{others.length}</span>
          </summary>
          {others.map(field)}
        </details>
      )}
    </>
  );
}
