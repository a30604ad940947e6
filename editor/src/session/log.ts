/** The recent activity of this page for the diagnosis file: events, refusals, faults. It is not sent. */

import type { DiaryEntry } from "../store/runtime";
import { getState } from "../store/store";

/** Number of entries, and characters of each. */
const MOST = 400;
const LONGEST = 400;

export function note(kind: DiaryEntry["kind"], text: string): void {
  const { diary } = getState().runtime;
  diary.push({ time: new Date().toISOString(), kind, text: text.slice(0, LONGEST) });
  if (diary.length > MOST) diary.splice(0, diary.length - MOST);
}

/** Record the errors of the page from now on. */
export function recordErrors(): void {
  window.addEventListener("error", ({ message, filename, lineno }) =>
    note("fault", `${message} (${filename}:${lineno})`),
  );
  window.addEventListener("unhandledrejection", ({ reason }) =>
    note("fault", reason instanceof Error ? `${reason.message}\n${reason.stack ?? ""}` : String(reason)),
  );
}
