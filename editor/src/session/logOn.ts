/** Log-on of persons at a shared device, and the session that continues it after a lost connection. */

import { translate } from "../i18n/serverMessages";
import { type LogOnArgs, type LogOnChangedData, type LogOnData, ROLES } from "../protocol/types";
import { getState, setConnection } from "../store/store";
import { call } from "./connection";

declare module "../store/runtime" {
  interface Runtime {
    /** Receives the person who logs on while the page waits for one. */
    takeLogOn?: ((data: LogOnData) => void) | undefined;
  }
}

/** Stored for this page only, so that another person who opens the browser again has to log on. */
const KEY = "arcor2-hw.session";

function storeSession(session: string): void {
  setConnection({ session });
  try {
    sessionStorage.setItem(KEY, session);
  } catch {
    // private windows of some browsers refuse it
  }
}

function storedSession(): string {
  try {
    return sessionStorage.getItem(KEY) ?? "";
  } catch {
    return getState().connection.session;
  }
}

/** Continue the session of this page, or wait until a person logs on. */
export async function waitForPerson(): Promise<void> {
  applyLogOn((await resumeSession()) ?? (await nextLogOn()));
  setConnection({ status: "joining", reason: "" });
}

async function resumeSession(): Promise<LogOnData | null> {
  let tried = "";
  // Another session may have started by the card of the next person.
  for (let session = storedSession(); session && session !== tried; session = storedSession()) {
    const data = await call("LogOn", { session }).catch(() => null);
    if (data) return data;
    tried = session;
  }
  return null;
}

function nextLogOn(): Promise<LogOnData> {
  storeSession("");
  return new Promise((resolve) => {
    getState().runtime.takeLogOn = resolve;
    setConnection({ status: "person" });
  });
}

/** Log a person on. Reject with the refusal of the server. */
export async function logOn(args: LogOnArgs): Promise<void> {
  const data = await call("LogOn", args);
  applyLogOn(data);
  const { runtime } = getState();
  runtime.takeLogOn?.(data);
  runtime.takeLogOn = undefined;
}

/** Log the person off; the log-on screen follows. */
export const logOff = (): Promise<unknown> => call("LogOff");

/** Handle LogOnChanged. `enter` starts the log-on again after a log-off. */
export function handleLogOnChanged(data: LogOnChangedData, enter: () => void): void {
  setConnection({ role: ROLES[data.role] });
  if (data.person) return;
  setConnection({ reason: translate({ ...data, text: data.reason }) });
  enter();
}

function applyLogOn({ person, role, session, log_off_after }: LogOnData): void {
  storeSession(session);
  setConnection({ user: person.name, role: ROLES[role], logOffAfter: log_off_after });
}
