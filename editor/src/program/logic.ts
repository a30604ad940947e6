/** Questions about the steps of a program: what follows what, what can be branched on, which way is still free. */

import { t } from "@lingui/core/macro";
import type { Action, LogicItem, ObjectAction, ProjectLogicIf } from "../protocol/types";
import type { Of, OpenDocument, State } from "../store/state";

export const START = "START";
export const END = "END";
const BRANCHABLE = new Set(["boolean", "integer", "integer_enum", "string_enum"]);

/** The action, START or END at one side of a step: ends may name a flow behind a slash. */
export const placeOf = (end: string): string => end.split("/")[0] ?? end;

export const outgoing = (doc: OpenDocument, id: string): LogicItem[] =>
  Object.values(doc.logic).filter((item) => placeOf(item.start) === id);
export const incoming = (doc: OpenDocument, id: string): LogicItem[] =>
  Object.values(doc.logic).filter((item) => placeOf(item.end) === id);

/** What an action's type says of it; undefined when it is not known (yet, or any more). */
export function metaOf(
  types: State["types"],
  doc: OpenDocument,
  action: Pick<Action, "type">,
): ObjectAction | undefined {
  const [objectId = "", method] = action.type.split("/");
  const type = doc.objects[objectId]?.type;
  return type === undefined ? undefined : types.actions[type]?.find((each) => each.name === method);
}

function reached(doc: OpenDocument, from: string, next: (doc: OpenDocument, id: string) => string[]): Set<string> {
  const found = new Set<string>();
  const waiting = next(doc, from);
  for (let id = waiting.pop(); id !== undefined; id = waiting.pop()) {
    if (found.has(id)) continue;
    found.add(id);
    waiting.push(...next(doc, id));
  }
  return found;
}

/** Everything that comes after an action. */
export const after = (doc: OpenDocument, id: string): Set<string> =>
  reached(doc, id, (of, each) => outgoing(of, each).map((item) => placeOf(item.end)));
/** Everything that comes before an action. */
export const before = (doc: OpenDocument, id: string): Set<string> =>
  reached(doc, id, (of, each) => incoming(of, each).map((item) => placeOf(item.start)));

export interface Result {
  action: Of<Action>;
  index: number;
  name: string;
  type: string;
}

/** The results of an action that are kept. */
export function resultsOf(doc: OpenDocument, types: State["types"], action: Of<Action>): Result[] {
  const returns = metaOf(types, doc, action)?.returns ?? [];
  const outputs = action.flows.find((flow) => flow.type === "default")?.outputs ?? [];
  return returns.flatMap((type, index) => {
    const name = outputs[index];
    return name === undefined ? [] : [{ action, index, name, type }];
  });
}

/**
 * Results of a type that an action may use: those of actions that come before it. One that is not connected yet may
 * use all but those that need it.
 */
export function usable(doc: OpenDocument, types: State["types"], id: string, type: string): Result[] {
  const earlier = before(doc, id);
  const later = after(doc, id);
  const free = incoming(doc, id).length === 0;
  return Object.values(doc.actions)
    .filter((each) => each.id !== id && (free ? !later.has(each.id) : earlier.has(each.id)))
    .flatMap((each) => resultsOf(doc, types, each))
    .filter((result) => result.type === type);
}

export const linkTo = (result: Result): string => `${result.action.id}/default/${result.index}`;

/** The result that a link or condition names. */
export function resultAt(doc: OpenDocument, types: State["types"], link: string): Result | undefined {
  const [id = "", , index = ""] = link.split("/");
  const action = doc.actions[id];
  return action && resultsOf(doc, types, action).find((each) => each.index === Number(index));
}

/** What a step from an action may depend on: its own results first, then earlier ones. */
export function conditionsOf(doc: OpenDocument, types: State["types"], id: string): Result[] {
  const own = doc.actions[id];
  if (!own) return [];
  const earlier = before(doc, id);
  const others = Object.values(doc.actions).filter((each) => earlier.has(each.id));
  return [own, ...others].flatMap((each) => resultsOf(doc, types, each)).filter((each) => BRANCHABLE.has(each.type));
}

/** What a new step from an action has to be, so that the server takes it beside those that there are. */
export interface NewStep {
  condition?: ProjectLogicIf;
  /** A step without a condition that needs one first, because there will be two. */
  first?: { item: LogicItem; condition: ProjectLogicIf };
}

/** Give what is free for another step from `from`; a sentence when there is nothing. */
export function freeStep(doc: OpenDocument, types: State["types"], from: string): NewStep | string {
  const siblings = outgoing(doc, from);
  if (siblings.length === 0) return {};
  if (from === START) return t`A program has one first action. Move the connection from Start instead.`;
  const asked = siblings.find((each) => each.condition)?.condition;
  const plain = siblings.find((each) => !each.condition);
  const own = asked ? resultAt(doc, types, asked.what) : conditionsOf(doc, types, from)[0];
  const name = doc.actions[from]?.name ?? t`This action`;
  if (!own) return t`${name} already has a next step, and no result to branch on.`;
  const what = asked?.what ?? linkTo(own);
  const taken = siblings.flatMap((each) => (each.condition?.what === what ? [each.condition.value] : []));
  const free = firstFree(own.type, taken);
  if (free === undefined) return t`${name} has no free branch.`;
  if (own.type !== "boolean" || !plain) return { condition: { what, value: free } };
  return { condition: { what, value: "false" }, first: { item: plain, condition: { what, value: "true" } } };
}

function firstFree(type: string, taken: string[]): string | undefined {
  if (type === "boolean") return ["true", "false"].find((each) => !taken.includes(each));
  if (type === "string_enum") {
    for (let number = 1; ; number++) if (!taken.includes(`"value ${number}"`)) return `"value ${number}"`;
  }
  for (let number = 0; ; number++) if (!taken.includes(String(number))) return String(number);
}

/** Why a step cannot lead there; empty when it can. The server has the last word. */
export function cannotLead(doc: OpenDocument, from: string, to: string, item = ""): string {
  if (to === START) return t`Start cannot follow a step.`;
  if (from === END) return t`Nothing can follow End.`;
  if (from === to) return t`An action cannot follow itself.`;
  if (from === START && to === END) return t`Put an action between Start and End.`;
  const others = outgoing(doc, from).filter((each) => each.id !== item);
  if (others.some((each) => placeOf(each.end) === to)) return t`These steps are already connected.`;
  if (after(doc, to).has(from)) return t`This connection would create a loop.`;
  return "";
}

/** A condition as words: "passed is yes". */
export function conditionWords(doc: OpenDocument, types: State["types"], item: LogicItem): string {
  const { condition } = item;
  if (!condition) return outgoing(doc, placeOf(item.start)).length > 1 ? t`else` : "";
  const result = resultAt(doc, types, condition.what);
  const own = result?.action.id === placeOf(item.start);
  const value =
    condition.value === "true"
      ? t`yes`
      : condition.value === "false"
        ? t`no`
        : condition.value.replace(/^"(.*)"$/, "$1");
  return own && result?.type === "boolean" ? value : `${result?.name ?? t`result`} = ${value}`;
}
