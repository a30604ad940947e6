/** The scene in operation: online, offline, and stop. */

import { t } from "@lingui/core/macro";
import { call, serves } from "../session/connection";
import { tell } from "../store/store";
import { ask, sentence } from "./asking";
import { endHolds } from "./holds";

/** Go online; devices that fail are left out where the server can do without them. */
export const goOnline = () => ask(serves("StartSceneKeepGoing") ? "StartSceneKeepGoing" : "StartScene");
export const goOffline = () => ask("StopScene");
export const retryObject = (object_id: string) => ask("RetryObject", { object_id }, { deadline: 60 });

/** Seconds for the answer of a stop; the server gives the devices three. */
const STOPPED_WITHIN = 5;

/**
 * Stop the program, every robot and device, and the action that is being tried, and say at once what was not stopped.
 * This is a functional stop, not a safety function.
 */
export async function stopMotion(): Promise<void> {
  const answer = call("StopAll", undefined, { deadline: STOPPED_WITHIN });
  endHolds();
  let reasons: string[];
  try {
    reasons = (await answer).outcomes.filter((each) => !each.stopped).map((each) => each.reason ?? each.name);
  } catch (error) {
    reasons = [sentence(error)];
  }
  if (reasons.length > 0)
    tell(
      "error",
      t`Not stopped: ${reasons.map((each) => each.replace(/\.$/, "")).join("; ")}. Use the emergency stop.`,
    );
}
