/** Sections of the panel about actions, connections, START and END; their bodies are loaded when they are needed. */

import { msg } from "@lingui/core/macro";
import { calledBy, metaOf } from "../../program/operands";
import { parallelOf } from "../../program/parallel";
import { END, isErrorExit, START } from "../../program/steps";
import { lazyComponent } from "../kit/lazy";
import type { Section } from "../workplace/section";

const isAction: Section["applies"] = ({ kind }) => kind === "action";
/** Parallel work has neither parameters nor results. */
const takes: Section["applies"] = ({ kind, id }, { doc }) => kind === "action" && !doc?.actions[id]?.branches;

export const programSections: readonly Section[] = [
  {
    id: "function",
    title: msg`Function`,
    applies: ({ kind, id }, { doc }) =>
      kind === "action" && doc !== null && calledBy(doc, doc.actions[id]) !== undefined,
    Body: lazyComponent(() => import("../functions/CallSection")),
  },
  {
    id: "parallel",
    title: msg`Branches`,
    applies: ({ kind, id }, { doc }) => kind === "action" && doc?.actions[id]?.branches !== undefined,
    Body: lazyComponent(() => import("../functions/Branches")),
  },
  {
    id: "taken",
    title: msg`Parameters of the function`,
    applies: ({ id }, { doc }) => id === START && doc !== null && doc.path.length > 0,
    Body: lazyComponent(() => import("../functions/Signature")),
  },
  {
    id: "returned",
    title: msg`Results of the function`,
    applies: ({ id }, { doc }) => id === END && doc !== null && doc.path.length > 0,
    Body: lazyComponent(() => import("../functions/Signature")),
  },
  { id: "try", title: msg`Commands`, applies: isAction, Body: lazyComponent(() => import("./ActionCommands")) },
  {
    id: "parameters",
    title: msg`Parameters`,
    applies: takes,
    Body: lazyComponent(() => import("./ActionParameters")),
  },
  {
    id: "next",
    title: msg`Next step`,
    applies: ({ kind, id }, state) =>
      state.doc?.project?.has_logic === true &&
      (kind === "action" ? !parallelOf(state.doc).has(id) : kind === "terminal" && id === "START"),
    Body: lazyComponent(() => import("./Next")),
  },
  {
    id: "retry",
    title: msg`Automatic retry`,
    applies: ({ kind, id }, { doc, types }) => {
      const action = kind === "action" ? doc?.actions[id] : undefined;
      if (!doc || !action) return false;
      return action.retry !== undefined || metaOf(types, doc, action)?.meta.again === "safe";
    },
    Body: lazyComponent(() => import("./Retry")),
  },
  { id: "results", title: msg`Results`, applies: takes, Body: lazyComponent(() => import("./Results")) },
  {
    id: "step",
    title: msg`Condition`,
    applies: ({ kind, id }, state) => kind === "logic" && !isErrorExit(state.doc?.logic[id]),
    Body: lazyComponent(() => import("./Step")),
  },
  {
    id: "error-exit",
    title: msg`If the action fails`,
    applies: ({ kind, id }, state) => kind === "logic" && isErrorExit(state.doc?.logic[id]),
    Body: lazyComponent(() => import("./ErrorExit")),
  },
  {
    id: "breakpoint",
    title: msg`Breakpoint`,
    applies: ({ kind }, state) => kind === "point" && state.doc?.project != null,
    Body: lazyComponent(() => import("./Breakpoint")),
  },
  {
    id: "puck",
    title: msg`In the view`,
    applies: ({ kind }) => kind === "terminal" || kind === "action",
    Body: lazyComponent(() => import("./Puck")),
  },
];
