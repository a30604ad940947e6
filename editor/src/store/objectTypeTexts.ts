/** Names and descriptions of object types, their settings and actions in the user's language. */

import { type ServerMessage, translate } from "../i18n/serverMessages";
import type { ObjectAction, ObjectTypeMeta, ParameterMeta } from "../protocol/types";

/** Return an object type with a display name and with its texts in the user's language. */
export function translatedType(type: ObjectTypeMeta): ObjectTypeMeta {
  return {
    ...described(type),
    display_name: translate({ text: type.display_name ?? type.type }),
    settings: type.settings.map((each) => described<ParameterMeta>(each)),
  };
}

/** Return an action with its texts in the user's language. */
export function translatedAction(action: ObjectAction): ObjectAction {
  return { ...described(action), parameters: action.parameters.map((each) => described<ParameterMeta>(each)) };
}

interface Described extends Omit<ServerMessage, "text"> {
  description?: string;
  /** A text that `key` and `values` translate. */
  problem?: string;
}

function described<Item extends Described>(item: Item): Item {
  const { description, problem, key, values } = item;
  return {
    ...item,
    ...(description === undefined ? {} : { description: translate({ text: description }) }),
    ...(problem === undefined ? {} : { problem: translate({ text: problem, key, values }) }),
  };
}
