/** The program as nodes and edges, laid out from top to bottom. Pure functions. */

import { Graph, layout } from "@dagrejs/dagre";
import { plural, t } from "@lingui/core/macro";
import { detailOf } from "../../program/functions";
import {
  type BranchKind,
  branchKind,
  calledBy,
  conditionWords,
  END,
  hasComparisons,
  isConditional,
  nextSteps,
  placeOf,
  resultsOf,
  START,
} from "../../program/logic";
import { callsIn, isParallel, parallelOf } from "../../program/parallel";
import { valuesOf } from "../../program/step";
import type { Action } from "../../protocol/types";
import type { OnPoint, OpenDocument, State } from "../../store/state";

const NODE = { width: 250, height: 66 };
/** Height of a node with a name only. */
const BARE = 46;
/** Additional height for a line of parameters. */
const LINE = 21;
/** Additional height for the free branches. */
const BRANCHES = 22;
/** Additional height for a call that parallel work runs. */
export const LANE = 46;
const TERMINAL = { width: 132, height: 68 };

/** A free branch of an action: the next step, one for a value of its result, or an error exit. */
export interface Branch {
  id: "next" | "true" | "false" | "branch" | "error";
  label: string;
  /** `<action>/default/<index>`, for a value of a result. */
  what?: string;
}

export interface Box {
  id: string;
  kind: "action" | "start" | "end" | "fold";
  name: string;
  detail: string;
  /** Its most important parameters as text; empty if it has none. */
  values: string;
  /** Id of the function that it calls. */
  called?: string | undefined;
  /** Icon that the type of its device declares. */
  icon?: string | undefined;
  branches: Branch[];
  /** The calls that it runs at once. */
  lanes?: OnPoint<Action>[] | undefined;
  /** Folded actions in their order. */
  run: string[];
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface Line {
  id: string;
  from: string;
  to: string;
  words: string;
  branch: BranchKind;
}

/** Return the node id of a folded sequence; no action has such an id. */
export const foldOf = (run: readonly string[]): string => `fold/${run[0] ?? ""}`;

/** `folded` are the folded sequences. */
export function graphOf(
  doc: OpenDocument,
  types: State["types"],
  folded: readonly string[][] = [],
): { boxes: Box[]; lines: Line[] } {
  const branches = parallelOf(doc);
  const into = new Map(folded.flatMap((run) => run.map((id) => [id, foldOf(run)] as const)));
  const shown = (id: string) => into.get(id) ?? id;
  const lines = Object.values(doc.logic)
    .map(
      (item): Line => ({
        id: item.id,
        from: shown(placeOf(item.start)),
        to: shown(placeOf(item.end)),
        words: conditionWords(doc, types, item),
        branch: branchKind(item),
      }),
    )
    .filter(({ from, to }) => from !== to);
  const bare: Omit<Box, "x" | "y">[] = [
    {
      id: START,
      kind: "start",
      name: t`Start`,
      detail: "",
      values: "",
      branches: lines.some((each) => each.from === START) ? [] : [{ id: "next", label: t`next` }],
      run: [],
      ...TERMINAL,
    },
    ...Object.values(doc.actions)
      .filter((action) => !into.has(action.id) && !branches.has(action.id))
      .map((action) => {
        const values = valuesOf(doc, types, action);
        const lanes = isParallel(action) ? callsIn(doc, action) : undefined;
        return {
          id: action.id,
          kind: "action" as const,
          name: action.name,
          detail: lanes ? "" : detailOf(doc, action),
          lanes,
          called: calledBy(doc, action)?.id,
          values,
          icon: types.byName[doc.objects[action.type.split("/")[0] ?? ""]?.type ?? ""]?.icon,
          run: [],
          ...sized(branchesOf(doc, types, action.id), values !== "", lanes?.length),
        };
      }),
    ...folded.map((run) => ({
      id: foldOf(run),
      kind: "fold" as const,
      name: plural(run.length, { one: "# action", other: "# actions" }),
      detail: run.map((id) => doc.actions[id]?.name ?? "").join(", "),
      values: "",
      run,
      ...sized(branchesOf(doc, types, run.at(-1) ?? "")),
    })),
    { id: END, kind: "end", name: t`End`, detail: "", values: "", branches: [], run: [], ...TERMINAL },
  ];
  const places = placed(bare, lines);
  return { boxes: bare.map((box) => ({ ...box, ...(places.get(box.id) ?? { x: 0, y: 0 }) })), lines };
}

/** Last and first action of a node. */
export const lastIn = (box: Pick<Box, "id" | "kind" | "run">): string =>
  box.kind === "fold" ? (box.run.at(-1) ?? box.id) : box.id;
export const firstIn = (box: Pick<Box, "id" | "kind" | "run">): string =>
  box.kind === "fold" ? (box.run[0] ?? box.id) : box.id;

function sized(branches: Branch[], values = false, lanes = 0): Pick<Box, "branches" | "width" | "height"> {
  const free = branches.length > 0 ? BRANCHES : 0;
  const height = (lanes > 0 ? BARE : NODE.height) + free + (values ? LINE : 0) + lanes * LANE;
  return { branches, width: NODE.width, height };
}

/** Return the free branches of an action. */
function branchesOf(doc: OpenDocument, types: State["types"], id: string): Branch[] {
  const action = doc.actions[id];
  if (!action) return [];
  const branches = nextSteps(doc, id);
  const result = resultsOf(doc, types, action).find(
    (each) => each.type === "boolean" || each.type === "integer" || each.type.endsWith("_enum"),
  );
  if (!result) return branches.length === 0 ? [{ id: "next", label: t`next` }] : [];
  if (result.type !== "boolean")
    return [branches.length === 0 ? { id: "next", label: t`next` } : { id: "branch", label: t`branch` }];
  const what = `${id}/default/${result.index}`;
  const asked = (value: string) => branches.some((each) => each.condition?.value === value);
  if (branches.some((each) => !isConditional(each) || hasComparisons(each)))
    return [{ id: "branch", label: t`branch` }];
  const free: Branch[] = [];
  if (!asked("true")) free.push({ id: "true", label: t`yes`, what });
  if (branches.length === 0) free.push({ id: "next", label: t`next` });
  if (!asked("false")) free.push({ id: "false", label: t`no`, what });
  return free;
}

function placed(boxes: Omit<Box, "x" | "y">[], lines: Line[]): Map<string, { x: number; y: number }> {
  const graph = new Graph({ multigraph: true });
  graph.setGraph({ rankdir: "TB", nodesep: 36, ranksep: 44, marginx: 20, marginy: 20 });
  graph.setDefaultEdgeLabel(() => ({}));
  for (const { id, width, height } of boxes) graph.setNode(id, { width, height });
  for (const { id, from, to, words } of lines) {
    if (graph.hasNode(from) && graph.hasNode(to))
      // A branch starts right after its action, and waits where it joins.
      graph.setEdge(from, to, { width: words.length * 8, height: 18, labelpos: "c", weight: words ? 2 : 1 }, id);
  }
  layout(graph);
  return new Map(
    boxes.map(({ id, width, height }) => {
      const { x, y } = graph.node(id) as { x: number; y: number };
      return [id, { x: x - width / 2, y: y - height / 2 }];
    }),
  );
}
