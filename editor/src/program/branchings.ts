/** Actions at which a program branches, and the texts for each branch. Pure functions. */

import { inScope } from "../store/scope";
import type { OpenDocument, State } from "../store/state";
import { conditionWords } from "./logic";
import { nextSteps, placeOf } from "./steps";

interface Branching {
  id: string;
  name: string;
  /** The next action or END, and the condition in words. */
  branches: { to: string; when: string }[];
}

/** Return the actions of the program and its called functions that have several next actions. */
export function branchings(doc: OpenDocument, types: State["types"]): Branching[] {
  const bodies = [inScope(doc, []), ...Object.keys(doc.functions).map((id) => inScope(doc, [id]))];
  const called = new Set(bodies.flatMap((body) => Object.values(body.actions).map(({ type }) => type.split("/")[0])));
  return bodies
    .filter(({ path: [id] }) => id === undefined || called.has(id))
    .flatMap((body) =>
      Object.values(body.actions).map(({ id, name }) => {
        const branches = nextSteps(body, id).map((step) => ({
          to: placeOf(step.end),
          when: conditionWords(body, types, step),
        }));
        const first = (to: string) => branches.findIndex((each) => each.to === to);
        return { id, name, branches: branches.filter(({ to }, n) => first(to) === n) };
      }),
    )
    .filter(({ branches }) => branches.length > 1);
}

/** Return the chosen branches that still exist. */
export function existingChoices(
  found: readonly Branching[],
  chosen: Readonly<Record<string, string>>,
): Record<string, string> {
  const kept = found.flatMap(({ id, branches }) =>
    branches.filter(({ to }) => chosen[id] === to).map(({ to }) => [id, to]),
  );
  return Object.fromEntries(kept);
}
