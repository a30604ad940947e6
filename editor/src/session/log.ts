/** What this page did recently, for the diagnosis file: events, refusals, faults. It is not sent anywhere. */

/** Number of entries, and characters of each. */
const MOST = 400;
const LONGEST = 400;

export interface Entry {
  time: string;
  what: "event" | "refused" | "fault" | "connection";
  text: string;
}

const entries: Entry[] = [];

export function note(what: Entry["what"], text: string): void {
  entries.push({ time: new Date().toISOString(), what, text: text.slice(0, LONGEST) });
  if (entries.length > MOST) entries.splice(0, entries.length - MOST);
}

/** Oldest first. */
export const diary = (): readonly Entry[] => entries;

if (typeof window !== "undefined") {
  window.addEventListener("error", ({ message, filename, lineno }) =>
    note("fault", `${message} (${filename}:${lineno})`),
  );
  window.addEventListener("unhandledrejection", ({ reason }) =>
    note("fault", reason instanceof Error ? `${reason.message}\n${reason.stack ?? ""}` : String(reason)),
  );
}
