/** Messages of the running program for the operator. */

import { anyAction } from "../store/scope";
import type { State } from "../store/state";

/** Return the text of the latest `show_message` of the running program, an empty string if there is none. */
export function shownMessage({ doc, program }: Pick<State, "doc" | "program">): string {
  const shows = (id: string) => {
    const [object = "", method] = (doc && anyAction(doc, id))?.type.split("/") ?? [];
    return method === "show_message" && doc?.objects[object]?.type === "FlowActions";
  };
  const text = program.trace.findLast((each) => shows(each.action_id))?.parameters?.[0];
  return text === undefined ? "" : String(JSON.parse(text));
}

/**
 * The address that the server adds at the end of a message, and IP addresses and serial ports in a sentence, with their
 * preposition.
 */
const LABEL = /(?<=\S) \[([^[\]]+)\]$/;
const HOST =
  / (?:\((?:[\p{L} ]+ )?|\p{Ll}{2,5} )?((?:socket:\/\/)?(?:\d{1,3}\.){3}\d{1,3}(?::\d+)?|\/(?:dev|tmp)\/[\w/-]+)\)?/gu;

/** Split a message of a device into the text for operators, and the addresses in it, which are for technicians. */
export function splitAddress(message: string): { text: string; address: string } {
  const found = new Set<string>();
  const take = (_: string, address: string) => {
    found.add(address);
    return "";
  };
  const text = message.replace(LABEL, take).replace(HOST, take);
  return { text, address: [...found].join(", ") };
}
