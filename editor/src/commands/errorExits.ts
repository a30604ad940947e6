/** Error exits of actions: add one, choose its kinds of errors, and store the error for later actions. */

import { t } from "@lingui/core/macro";
import { freeKinds } from "../program/errorExits";
import { cannotLead } from "../program/logic";
import { freeErrorName } from "../program/naming";
import { call } from "../session/connection";
import { getState, notify, select } from "../store/store";
import { awaited } from "./ownEvents";
import { ask, newStep, refusal, sentence, withLock } from "./requests";

/** Add an error exit from an action and store the error, as one step of undo. Notify the user if it is impossible. */
export async function addErrorExit(from: string, to: string): Promise<void> {
  const { doc } = getState();
  const action = doc?.actions[from];
  if (!doc || !action) return;
  const why = cannotLead(doc, from, to, "", true);
  if (why) return notify("info", why);
  const [kind] = freeKinds(doc, from);
  if (kind === undefined) return notify("info", t`${action.name} already has an exit for every kind of error.`);
  const step = newStep();
  if (!(await ask("AddLogicItem", { start: from, end: to, error_kinds: [kind] }, step))) return;
  if (!action.error_output) {
    const named = { action_id: from, error_output: freeErrorName(doc, action) };
    await withLock(from, () => call("UpdateAction", named, step)).catch((error) => notify("error", sentence(error)));
  }
  const added = await awaited((state) =>
    Object.values(state.doc?.logic ?? {}).find((each) => each.start === from && each.error_kinds?.includes(kind)),
  ).catch(() => null);
  if (added) select({ kind: "logic", id: added.id });
}

/** Change the kinds of errors of an exit. Return why it was refused, for the form. */
export const setErrorKinds = (id: string, error_kinds: string[]): Promise<string> =>
  refusal(() => {
    const item = getState().doc?.logic[id];
    if (!item) throw new Error(t`The connection no longer exists.`);
    return call("UpdateLogicItem", { logic_item_id: id, start: item.start, end: item.end, error_kinds });
  });

/** Name the error of an action; an empty name: do not store it. Return why it was refused. */
export const nameError = (action_id: string, error_output: string): Promise<string> =>
  refusal(() => withLock(action_id, () => call("UpdateAction", { action_id, error_output })));
