/** Problems of a program, found before it runs. */

import { t } from "@lingui/core/macro";
import type { Action } from "../protocol/types";
import { inScope, scopeOf } from "../store/scope";
import type { OnPoint, OpenDocument, State } from "../store/state";
import { branchProblems, canLackResults } from "./completeness";
import { errorAt, hasFailed, linkToError, partNames } from "./errorExits";
import { onAllPaths, resultOf } from "./functions";
import { decoded } from "./json";
import { whyNotAtOnce } from "./lanes";
import {
  after,
  calledBy,
  canHaveFailed,
  END,
  hasComparisons,
  incoming,
  linkTo,
  metaOf,
  nextSteps,
  operandAt,
  outgoing,
  PASSED_ON,
  placeOf,
  resultAt,
  resultsOf,
  START,
  variableNamed,
  whenOf,
} from "./logic";
import { callsIn, isParallel, parallelOf, runnerOf } from "./parallel";
import { reachOfAction } from "./reach";

export interface Problem {
  /** Id of the faulty item, which a tap selects. */
  id: string;
  text: string;
  /** A warning does not prevent a run. */
  level: "error" | "warn";
  /** Id of the function that contains the item; an empty string for the program. */
  scope: string;
}

/** Return the problems of the program and of all functions. */
export function problemsOf(doc: OpenDocument, types: State["types"], reach: State["reach"] = {}): Problem[] {
  const functions = Object.values(doc.functions).flatMap(({ id, name }) =>
    problemsIn(inScope(doc, [id]), types, reach).map((each) => ({ ...each, text: t`${name}: ${each.text}` })),
  );
  return [...problemsIn(inScope(doc, []), types, reach), ...functions];
}

/** Return the problems of the open program or function. */
export const problemsHere = (doc: OpenDocument | null, problems: readonly Problem[]): Problem[] =>
  problems.filter((each) => doc !== null && each.scope === scopeOf(doc));

function problemsIn(doc: OpenDocument, types: State["types"], reach: State["reach"]): Problem[] {
  const { project } = doc;
  const scope = scopeOf(doc);
  if (!project) return [];
  const found: Problem[] = [];
  const error = (id: string, text: string) => found.push({ id, text, level: "error", scope });
  const warn = (id: string, text: string) => found.push({ id, text, level: "warn", scope });
  if (project.has_logic) ofLogic(doc, types, error, warn);
  const open = doc.functions[scope];
  for (const { link } of open?.returns ?? []) {
    const result = open && resultOf(open, link);
    if (!result) error(END, t`A result of the function no longer exists.`);
    else if (!onAllPaths(doc, link.split("/")[0] ?? ""))
      error(END, t`The result ${result.name} is missing if ${result.action} does not run.`);
  }
  for (const action of Object.values(doc.actions)) {
    ofAction(doc, types, action, error, warn);
  }
  for (const action of Object.values(doc.actions)) {
    const there = reachOfAction(action, reach);
    if (there?.reach !== "out_of_reach" && there?.reach !== "in_collision") continue;
    warn(
      action.id,
      there.reason
        ? t`${action.name}: ${there.reason}`
        : there.reach === "in_collision"
          ? t`${action.name}: the robot collides at this pose.`
          : t`${action.name}: the robot cannot reach this pose.`,
    );
  }
  return found;
}

type Report = (id: string, text: string) => void;

function ofLogic(doc: OpenDocument, types: State["types"], error: Report, warn: Report): void {
  const used = after(doc, START);
  const branches = parallelOf(doc);
  if (outgoing(doc, START).length === 0) error(START, t`Start has no next step. Connect it to the first action.`);
  for (const action of Object.values(doc.actions)) {
    const steps = nextSteps(doc, action.id);
    const { name } = action;
    if (branches.has(action.id)) continue;
    if (!used.has(action.id)) {
      const loose = incoming(doc, action.id).length === 0;
      warn(
        action.id,
        loose
          ? t`${action.name} is never run: no step leads to it.`
          : t`${action.name} is never run: it cannot be reached from Start.`,
      );
      continue;
    }
    if (steps.length === 0) {
      error(action.id, t`${action.name} has no next step. Connect it to an action or to End.`);
      continue;
    }
    if (steps.some(hasComparisons)) {
      for (const { id, text } of branchProblems(doc, types, action.id)) error(id, text);
      continue;
    }
    const conditions = steps.flatMap((step) => (step.condition ? [step.condition] : []));
    const otherwise = steps.length > conditions.length;
    const first = conditions[0];
    if (!first || otherwise) continue;
    const result = resultAt(doc, types, first.what);
    const both = conditions.some((each) => each.value === "true") && conditions.some((each) => each.value === "false");
    if (!both) {
      const bool = first.value === "true" || first.value === "false";
      const output = result?.name ?? t`its result`;
      error(
        action.id,
        !bool
          ? t`${name}: no next step if none of the conditions is met.`
          : first.value === "true"
            ? t`${name}: no next step if ${output} is no.`
            : t`${name}: no next step if ${output} is yes.`,
      );
    }
  }
  for (const item of Object.values(doc.logic)) {
    const start = placeOf(item.start);
    const name = doc.actions[start]?.name ?? "";
    const compared = whenOf(item).comparisons.flatMap(({ what, other = what }) => [what, other]);
    if (compared.some((each) => !operandAt(doc, types, each))) {
      if (typesKnown(doc, types)) error(item.id, t`${name}: a step depends on a result that no longer exists.`);
      continue;
    }
    const early = compared
      .map((each) => resultAt(doc, types, each)?.action)
      .find((each) => each && runnerOf(doc, each.id) !== start && canLackResults(doc, each.id, start));
    if (early)
      error(
        item.id,
        t`${name}: a step depends on a result of ${early.name}, which does not run before it on all paths.`,
      );
  }
  if (
    !Object.values(doc.logic).some((item) => placeOf(item.end) === END) &&
    Object.keys(doc.actions).length > 0 &&
    outgoing(doc, START).length > 0
  ) {
    error(END, t`No step leads to End.`);
  }
}

function typesKnown(doc: OpenDocument, types: State["types"]): boolean {
  return Object.values(doc.objects).every((object) => object.type in types.actions);
}

function ofAction(
  doc: OpenDocument,
  types: State["types"],
  action: OpenDocument["actions"][string],
  error: Report,
  warn: Report,
): void {
  const [objectId = ""] = action.type.split("/");
  if (isParallel(action)) {
    const why = whyNotAtOnce(doc, callsIn(doc, action));
    if (why) error(action.id, t`${action.name}: ${why}`);
    return;
  }
  const object = doc.objects[objectId] ?? calledBy(doc, action);
  if (!object) return error(action.id, t`${action.name}: its device is no longer in the scene.`);
  if ("type" in object && !(object.type in types.actions)) return;
  const meta = metaOf(types, doc, action);
  if (!meta) return error(action.id, t`${action.name}: ${object.name} no longer has this action.`);
  if (meta.disabled)
    error(
      action.id,
      meta.problem ? t`${action.name}: ${meta.problem}` : t`${action.name}: this action cannot be used.`,
    );
  for (const wanted of meta.parameters) {
    const parameter = action.parameters.find((each) => each.name === wanted.name);
    const value = decoded(parameter?.value);
    if (!parameter) {
      if (wanted.default_value === undefined) error(action.id, t`${action.name}: ${wanted.name} is missing.`);
    } else if (parameter.type === "project_parameter") {
      if (!(String(value) in doc.parameters))
        error(action.id, t`${action.name}: the variable used for ${wanted.name} no longer exists.`);
    } else if (parameter.type === PASSED_ON) {
      if (!doc.functions[scopeOf(doc)]?.parameters.some((each) => each.name === value))
        error(action.id, t`${action.name}: the parameter of the function used for ${wanted.name} no longer exists.`);
    } else if (parameter.type === "link") {
      const link = String(value);
      const problem = /^[^/]*\/error\//.test(link)
        ? errorProblem(doc, action, wanted.name, link)
        : failedProblem(doc, action, wanted.name, link);
      if (problem) error(action.id, problem);
      if (problem !== undefined) continue;
      const result = resultAt(doc, types, link);
      if (!result) error(action.id, t`${action.name}: the result used for ${wanted.name} no longer exists.`);
      else if (doc.project?.has_logic && canLackResults(doc, result.action.id, action.id)) {
        const { name } = result.action;
        error(
          action.id,
          t`${action.name}: ${wanted.name} uses a result of ${name}, which does not run before it on all paths.`,
        );
      } else if (doc.project?.has_logic && !after(doc, runnerOf(doc, result.action.id)).has(runnerOf(doc, action.id))) {
        warn(
          action.id,
          t`${action.name}: ${wanted.name} uses a result of ${result.action.name}, which does not run before it.`,
        );
      }
    } else if (wanted.type === "joints" && doc.joints[String(value)]?.is_valid === false) {
      warn(
        action.id,
        t`${action.name}: the point of ${doc.joints[String(value)]?.name ?? ""} has moved. Update the joints.`,
      );
    }
  }
}

/** Return the problem of a link to an error; an empty string if there is none. */
function errorProblem(doc: OpenDocument, action: OnPoint<Action>, parameter: string, link: string): string {
  const part = errorAt(doc, link);
  if (!part) return t`${action.name}: the error used for ${parameter} is not stored.`;
  if (!doc.project?.has_logic || !after(doc, START).has(action.id) || hasFailed(doc, part.action.id, action.id))
    return "";
  const { name } = part.action;
  return t`${action.name}: ${parameter} uses the error of ${name}, which has not failed on all paths to it.`;
}

/** Return the problem of a link to a result of an action that can have failed; undefined if it cannot. */
function failedProblem(
  doc: OpenDocument,
  action: OnPoint<Action>,
  parameter: string,
  link: string,
): string | undefined {
  const source = doc.actions[link.split("/")[0] ?? ""];
  if (!source || !canHaveFailed(doc, source.id, action.id)) return undefined;
  return t`${action.name}: ${parameter} uses a result of ${source.name}, which can have failed before it.`;
}

/**
 * Return the ids of the actions that use a project parameter, a result, or the error of an action, and of the
 * connections that compare a project parameter.
 */
export function usersOf(
  doc: OpenDocument,
  types: State["types"],
  of: { parameter: string } | { action: string } | { error: string },
): string[] {
  const users: string[] = [];
  const links = new Set(
    "error" in of
      ? partNames().map((_, index) => linkToError({ action: { id: of.error }, index }))
      : "action" in of
        ? doc.actions[of.action]
          ? resultsOf(doc, types, doc.actions[of.action] as never).map(linkTo)
          : []
        : [],
  );
  for (const action of Object.values(doc.actions)) {
    const uses = action.parameters.some(({ type, value }) => {
      const id = String(decoded(value));
      return "parameter" in of ? type === "project_parameter" && id === of.parameter : type === "link" && links.has(id);
    });
    const { name } = "parameter" in of ? (doc.parameters[of.parameter] ?? { name: "" }) : { name: "" };
    const stores = variableNamed(doc, name) && action.flows.some((flow) => flow.outputs.includes(name));
    if (uses || stores) users.push(action.id);
  }
  for (const item of Object.values(doc.logic)) {
    if ("parameter" in of && whenOf(item).comparisons.some((one) => [one.what, one.other].includes(of.parameter)))
      users.push(item.id);
  }
  return users;
}
