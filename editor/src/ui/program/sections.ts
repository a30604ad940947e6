/** Sections of the panel about actions, connections, START and END; their bodies are loaded when they are needed. */

import { msg } from "@lingui/core/macro";
import { metaOf } from "../../program/logic";
import { isErrorExit } from "../../program/steps";
import { lazyComponent } from "../kit/lazy";
import type { Section } from "../workplace/section";

const isAction: Section["applies"] = ({ kind }) => kind === "action";

export const programSections: readonly Section[] = [
  { id: "try", title: msg`Do`, applies: isAction, Body: lazyComponent(() => import("./ActionCommands")) },
  {
    id: "parameters",
    title: msg`Parameters`,
    applies: isAction,
    Body: lazyComponent(() => import("./ActionParameters")),
  },
  {
    id: "next",
    title: msg`Next step`,
    applies: ({ kind, id }, state) =>
      state.doc?.project?.has_logic === true && (kind === "action" || (kind === "terminal" && id === "START")),
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
  { id: "results", title: msg`Results`, applies: isAction, Body: lazyComponent(() => import("./Results")) },
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
