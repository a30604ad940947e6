/** The enumerations that actions of a function take as values. Pure functions. */

import { t } from "@lingui/core/macro";
import type { OpenDocument, State } from "../store/state";
import { metaOf } from "./logic";
import { words } from "./naming";

export interface EnumerationUse {
  action: string;
  parameter: string;
  type: string;
  /** The value, as JSON. */
  json: string;
  label: string;
}

/** Return the parameters of the open actions whose value is a member of an enumeration. */
export const enumerationsOf = (doc: OpenDocument, types: State["types"]): EnumerationUse[] =>
  Object.values(doc.actions).flatMap((action) =>
    (metaOf(types, doc, action)?.parameters ?? []).flatMap(({ name, type }) => {
      const given = action.parameters.find((each) => each.name === name);
      if (!type.endsWith("_enum") || given?.type !== type) return [];
      const label = t`${words(name)} of ${action.name}`;
      return [{ action: action.id, parameter: name, type, json: given.value, label }];
    }),
  );
