/** The recent activity of this page for the diagnosis file: events, refusals, faults. It is not sent. */

import type { DiaryEntry } from "../store/runtime";
import { now } from "../store/store";

/** Number of entries, and characters of each. */
const MOST = 400;
const LONGEST = 400;

export function note(what: DiaryEntry["what"], text: string): void {
  const { diary } = now().runtime;
  diary.push({ time: new Date().toISOString(), what, text: text.slice(0, LONGEST) });
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
