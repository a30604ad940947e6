/** State, mode, authority and PLC of the cell in words. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import type { CellAuthority, CellMode, CellStateName, CellStatus } from "../../protocol/types";

export const STATES: Record<CellStateName, MessageDescriptor> = {
  stopped: msg`Stopped`,
  starting: msg`Starting`,
  idle: msg`Idle`,
  execute: msg`Running`,
  stopping: msg({ message: "Stopping", context: "PackML" }),
  aborting: msg`Aborting`,
  aborted: msg`Aborted`,
  holding: msg`Holding`,
  held: msg({ message: "Held", context: "PackML" }),
  unholding: msg`Resuming`,
  complete: msg`Complete`,
};

interface Option<Id> {
  id: Id;
  name: MessageDescriptor;
  /** The client that may start programs. */
  detail: MessageDescriptor;
}

export const MODES: readonly Option<CellMode>[] = [
  { id: "produce", name: msg`Produce`, detail: msg`Users or the PLC start programs.` },
  { id: "changeover", name: msg`Changeover`, detail: msg`Users start programs. The PLC cannot.` },
  { id: "maintenance", name: msg`Maintenance`, detail: msg`Only technicians start programs.` },
  { id: "manual", name: msg`Manual`, detail: msg`No program can start.` },
];
export const AUTHORITIES: readonly Option<CellAuthority>[] = [
  { id: "hub", name: msg`This server`, detail: msg`Users start programs, as the mode allows.` },
  { id: "plc", name: msg`The PLC`, detail: msg`The PLC starts programs. Users cannot start programs or go online.` },
  { id: "nobody", name: msg`Nobody`, detail: msg`No program can start.` },
];

const nameOf = <Id>(options: readonly Option<Id>[], id: Id): string => {
  const option = options.find((each) => each.id === id);
  return option ? i18n._(option.name) : String(id);
};

/** Return the command of the PLC, or the reason why the cell is aborted; an empty string otherwise. */
export function programText({ state, held_by_plc, job }: CellStatus): string {
  if (held_by_plc) return t`The PLC holds the program and resumes it.`;
  if (job !== undefined) return t`Job ${job} of the PLC is active.`;
  return state === "aborted" ? t`The last program failed, was aborted, or its process ended.` : "";
}

/** Return whether the life counter of the PLC changes. The word is empty as long as no PLC has connected. */
export function plcText({ plc, authority, opcua }: CellStatus): {
  word: string;
  tone: "good" | "bad" | "warn";
  text: string;
} {
  if (!plc && opcua) return { word: "", tone: "good", text: t`Plant systems connect by OPC UA.` };
  if (!plc) return { word: "", tone: "warn", text: t`The server has no connection for a PLC.` };
  const { listening, alive, peer } = plc;
  if (peer === undefined) return { word: "", tone: "warn", text: t`No PLC has written to ${listening} yet.` };
  if (alive) return { word: t`alive`, tone: "good", text: t`The life counter of the PLC at ${peer} changes.` };
  return {
    word: t`silent`,
    tone: authority === "plc" ? "bad" : "warn",
    text: t`The life counter of the PLC at ${peer} does not change.`,
  };
}

/** Return what the operator's screen shows about authority and mode; an empty string if both have their default. */
export function noteText(cell: CellStatus): string {
  const sentences: string[] = [];
  if (cell.authority === "nobody") sentences.push(t`Nobody commands this cell.`);
  if (cell.authority === "plc" && !cell.plc && cell.opcua) sentences.push(t`A plant system commands this cell.`);
  else if (cell.authority === "plc")
    sentences.push(
      cell.plc?.alive
        ? t`The PLC commands this cell.`
        : t`The PLC commands this cell, but its life counter does not change.`,
    );
  const mode = nameOf(MODES, cell.mode);
  if (cell.mode !== "produce") sentences.push(t`Mode: ${mode}.`);
  return sentences.join(" ");
}
