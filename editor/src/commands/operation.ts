/** The online scene: go online, go offline, stop. */

import { t } from "@lingui/core/macro";
import { inUserLanguage } from "../i18n/serverMessages";
import { call, serves } from "../session/connection";
import { notify } from "../store/store";
import { stopHoldToRun } from "./holdToRun";
import { ask, sentence } from "./requests";

/** Go online; devices that fail are left out if the server supports it. */
export const goOnline = () => ask(serves("StartSceneKeepGoing") ? "StartSceneKeepGoing" : "StartScene");
export const goOffline = () => ask("StopScene");
export const retryObject = (object_id: string) => ask("RetryObject", { object_id }, { deadline: 60 });

/** Time limit of Stop, s. The server allows the devices three seconds. */
const STOPPED_TIMEOUT = 5;

/**
 * Stop the program, every robot and device, and the running action, and report what was not stopped. This is a
 * functional stop, not a safety function.
 */
export async function stopMotion(): Promise<void> {
  const answer = call("StopAll", undefined, { deadline: STOPPED_TIMEOUT });
  stopHoldToRun();
  let reasons: string[];
  try {
    const missed = (await answer).outcomes.filter((each) => !each.stopped);
    reasons = missed.map((each) => inUserLanguage(each).reason ?? each.name);
  } catch (error) {
    reasons = [sentence(error)];
  }
  if (reasons.length > 0)
    notify(
      "error",
      t`Not stopped: ${reasons.map((each) => each.replace(/\.$/, "")).join("; ")}. Use the emergency stop.`,
    );
}
