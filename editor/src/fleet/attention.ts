/** The attention that cells need, with the reasons. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { clock, compareTexts } from "../formats";
import { translate } from "../i18n/serverMessages";
import { splitAddress } from "../program/messages";
import type { FleetCard, FleetState } from "../protocol/types";
import { STATES } from "../ui/cell/texts";
import type { IconName } from "../ui/kit/icons";

/** How urgently a cell needs attention, most urgently first. */
const LEVELS = ["need", "watch", "running", "ready", "gone"] as const;
export type Level = (typeof LEVELS)[number];

export const TITLES: Record<Level, MessageDescriptor> = {
  need: msg`Needs attention`,
  watch: msg`To check`,
  running: msg`Running`,
  ready: msg`Ready`,
  gone: msg`No signal`,
};
export const ICONS: Record<Level, IconName> = {
  need: "warn",
  watch: "info",
  running: "play",
  ready: "check",
  gone: "plug",
};

/** States in which a program runs. */
const ACTIVE: ReadonlySet<FleetState["state"]> = new Set(["starting", "execute", "unholding"]);

/** Return the level of a card. */
export function levelOf({ alive, conflict, state }: FleetCard): Level {
  if (conflict) return "need";
  if (!alive) return "gone";
  if (state.held || state.state === "aborted" || state.urgent > 0 || state.high > 0) return "need";
  if (state.medium > 0 || state.missing.length > 0 || state.state === "held" || state.state === "holding")
    return "watch";
  return ACTIVE.has(state.state) ? "running" : "ready";
}

/** Return the state of a cell in words. */
export function stateText({ alive, conflict, seen, state }: FleetCard): string {
  if (conflict) return t`Two servers use this name`;
  if (!alive) return t`No signal since ${clock(seen)}`;
  if (state.held) return t`Waits for a person`;
  if (state.program_state === "paused") return t`Paused`;
  return i18n._(STATES[state.state]);
}

/** Return why a cell needs attention; an empty string if it does not. */
export function reasonOf({ alive, conflict, seen, state }: FleetCard): string {
  if (conflict && !alive) return t`No signal since ${clock(seen)}`;
  if (conflict) return t`Its state may be that of another cell. Give each cell a name of its own.`;
  if (!alive) return "";
  const { first_alarm: alarm, missing } = state;
  if (alarm) {
    // Its address is for technicians, who see it in the cell.
    const { text } = splitAddress(translate(alarm.text_message ?? { text: alarm.text }, alarm.translations));
    return alarm.device ? t`${alarm.device}: ${text}` : text;
  }
  if (missing.length > 0) return t`Not connected: ${missing.join(", ")}`;
  return "";
}

/** Return the clients in control of the cell: the PLC, or the users who started the program or hold locks. */
export function controlOf({ authority, started_by, controlling }: FleetState): string {
  if (authority === "plc") return t`PLC`;
  return [...new Set([started_by, ...controlling].filter(Boolean))].join(", ");
}

/** Return the cards by level, sorted by name; levels without cards are left out. */
export function groups(cards: Iterable<FleetCard>): [Level, FleetCard[]][] {
  const sorted = [...cards].sort((one, other) => compareTexts(one.name, other.name) || compareTexts(one.id, other.id));
  const found = LEVELS.map((level): [Level, FleetCard[]] => [level, sorted.filter((card) => levelOf(card) === level)]);
  return found.filter(([, members]) => members.length > 0);
}
