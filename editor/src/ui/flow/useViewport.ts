/** The shown part of the graph: its start, then the running action or the selection, until the user moves it. */

import { useReactFlow, useStore } from "@xyflow/react";
import { useEffect, useRef } from "react";
import { START } from "../../program/logic";
import { isRunning } from "../../store/selectors";
import { useEditor } from "../../store/store";
import type { Box } from "./graph";
import { firstView, viewOf, wholeView } from "./viewport";

const SOON = { duration: 200 };

export interface Moves {
  /** The user moves the graph: it is not moved any more before the next run. */
  moved: () => void;
  /** The user asks for the whole graph; it stays whole when it grows. */
  whole: () => void;
}

/**
 * Show the start of the graph, and follow the running action. `scope` is the open function, which has its own graph.
 */
export function useViewport(boxes: readonly Box[], running: string, selected: string, scope: string): Moves {
  const { getViewport, setViewport } = useReactFlow();
  const width = useStore((state) => state.width);
  const height = useStore((state) => state.height);
  const shows = useRef<"nothing" | "start" | "whole" | "other">("nothing");
  const latest = useRef(boxes);
  latest.current = boxes;
  const ready = width > 0 && height > 0;
  const active = useEditor(isRunning);
  const followed = useRef(true);
  useEffect(() => {
    if (active) followed.current = true;
  }, [active]);

  const runs = running !== "" && followed.current;
  const shown = runs ? running : selected;
  const box = boxes.find((each) => each.id === shown || each.run.includes(shown));
  const some = box !== undefined;
  const number = boxes.length;
  const last = useRef({ scope, width });
  useEffect(() => {
    if (!ready || number === 0) return;
    const before = last.current;
    last.current = { scope, width };
    if (before.scope !== scope) shows.current = "nothing";
    else if (shows.current === "other") {
      // The middle stays in the middle when a panel or the 3D view takes a part of the width.
      const now = getViewport();
      if (before.width > 0 && before.width !== width)
        void setViewport({ ...now, x: now.x + (width - before.width) / 2 });
      return;
    }
    if (shows.current === "whole") return void setViewport(wholeView(latest.current, { width, height }));
    if (some && shows.current === "start") return;
    shows.current = "start";
    const start = latest.current.find((each) => each.id === START);
    void setViewport(firstView(latest.current, start, { width, height }));
  }, [ready, width, height, number, some, scope, getViewport, setViewport]);

  const { id, x, y } = box ?? {};
  useEffect(() => {
    const there = latest.current.find((each) => each.id === id);
    if (!ready || !there) return;
    const next = viewOf({ ...there, x: x ?? there.x, y: y ?? there.y }, getViewport(), { width, height }, runs);
    if (next) void setViewport(next, SOON);
  }, [ready, id, x, y, runs, width, height, getViewport, setViewport]);

  return {
    moved: () => {
      shows.current = "other";
      followed.current = false;
    },
    whole: () => {
      shows.current = "whole";
      void setViewport(wholeView(latest.current, { width, height }), SOON);
    },
  };
}
