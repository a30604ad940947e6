/** Messages of the running program for the operator. */

import type { State } from "../store/state";

/** Return the text of the latest `show_message` of the running program, an empty string if there is none. */
export function shownMessage({ doc, program }: Pick<State, "doc" | "program">): string {
  const shows = (id: string) => {
    const [object = "", method] = doc?.actions[id]?.type.split("/") ?? [];
    return method === "show_message" && doc?.objects[object]?.type === "FlowActions";
  };
  const text = program.trace.findLast((each) => shows(each.action_id))?.parameters?.[0];
  return text === undefined ? "" : String(JSON.parse(text));
}
