/** Continue a program that is held at a failed action. */

import { t } from "@lingui/core/macro";
import type { DecideHeldArgs, HeldData } from "../protocol/types";
import { call } from "../session/connection";
import { notify } from "../store/store";
import { refusal } from "./requests";

export type Decision = Omit<DecideHeldArgs, "number">;

/** Restarting the safety system of a controller takes 20 s. */
const ACKNOWLEDGE_TIMEOUT = 40;

/** Decide how the program continues. Return the reason of a refusal; notify the user of it if `notifies`. */
export async function decide(held: HeldData, decision: Decision, notifies = true): Promise<string> {
  const why = await refusal(() => call("DecideHeld", { number: held.number, ...decision }));
  if (why && notifies) notify("error", why);
  return why;
}

/** Acknowledge a safety stop of a robot (without a code), or an alarm. Return why it was refused. */
export async function acknowledge(object_id: string, code: string): Promise<string> {
  const why = await refusal(() =>
    call("AcknowledgeStop", { object_id, ...(code ? { code } : {}) }, { deadline: ACKNOWLEDGE_TIMEOUT }),
  );
  if (!why) notify("info", t`Acknowledged.`);
  return why;
}
