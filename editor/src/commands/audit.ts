/** The audit trail of the server: changes and commands with their users. */

import { t } from "@lingui/core/macro";
import { FILE_DEADLINE, rest } from "../session/rest";
import { saveAs } from "./files";

export type AuditOutcome = "done" | "refused" | "forbidden";

interface AuditChange {
  kind: string;
  id: string;
  before: unknown;
  after: unknown;
}

export interface AuditEntry {
  number: number;
  time: string;
  outcome: AuditOutcome;
  request: string;
  target: string;
  user: string;
  role: string;
  address: string;
  reason: string;
  changes: AuditChange[];
}

interface AuditCheck {
  problem: string;
  first: number;
  last: number;
}

/** Number of entries in one answer. */
export const PAGE = 50;

/** Return the newest entries with a text, below a number if it is not 0. Reject with a sentence. */
export async function loadEntries(text: string, outcome: AuditOutcome | "", before: number): Promise<AuditEntry[]> {
  const query = new URLSearchParams({ text, outcome, before: String(before), limit: String(PAGE) });
  return (await rest(`/api/audit?${query}`)).json();
}

/** Check whether entries were edited or removed. Reject with a sentence. */
export async function checkTrail(): Promise<AuditCheck> {
  return (await rest("/api/audit/check", { deadline: FILE_DEADLINE })).json();
}

/** Save all entries as CSV on this device. Reject with a sentence. */
export async function exportTrail(): Promise<void> {
  const failure = t`The audit trail is not available`;
  const response = await rest("/api/audit/export", { failure, deadline: FILE_DEADLINE });
  saveAs(await response.blob(), `audit-${new Date().toISOString().slice(0, 10)}.csv`);
}
