/** An arrow at the edge of the view that points to the selected item outside it; a tap turns the view. */

import { t } from "@lingui/core/macro";
import { useLayoutEffect, useRef, useState } from "react";
import { bearingOf, lookAt } from "../../engine/bearing";
import type { Engine } from "../../engine/engine";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { atEdge, type Rect } from "./edge";

/** Controls at the edge of the view. */
const OTHERS = ".view-controls, .centre-top > *, .stop, .aim-bar, .fly-pad, .insets, .puck-values";

export function OffScreen({ engine }: { engine: Engine }) {
  const id = useEditor((state) => state.ui.selection?.id ?? "");
  const name = useEditor((state) => nameOf(state, id));
  const [away, setAway] = useState(false);
  const button = useRef<HTMLButtonElement>(null);
  useLayoutEffect(() => {
    const update = () => {
      const at = id ? bearingOf(engine, id) : null;
      const shown = at !== null && !at.inView;
      setAway(shown);
      const view = button.current?.closest(".view")?.getBoundingClientRect();
      if (!shown || !button.current || !view) return;
      const { x, y, angle } = atEdge(at, view.width, view.height, controlAreas(view));
      button.current.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px) translate(-50%, -50%)`;
      button.current.style.setProperty("--turned", `${Math.round(angle)}deg`);
    };
    update();
    const end = engine.watch(update);
    // A new size is drawn some frames later: until then the arrow would be beyond the edge.
    const resized = new ResizeObserver(update);
    const around = button.current?.closest(".view");
    if (around) resized.observe(around);
    return () => {
      resized.disconnect();
      end();
    };
  }, [engine, id, away]);
  if (!away) return null;
  return (
    <button
      ref={button}
      type="button"
      className="off-screen"
      aria-label={t`Turn the view to ${name || t`the selected object`}`}
      title={name}
      onClick={() => lookAt(engine, id)}
    >
      <svg
        width="26"
        height="26"
        viewBox="0 0 24 24"
        fill="none"
        stroke="currentColor"
        strokeWidth="2.500"
        strokeLinecap="round"
        strokeLinejoin="round"
        aria-hidden="true"
      >
        <path d="M3 12h17M13 5l7 7-7 7" />
      </svg>
    </button>
  );
}

/** Return the areas of controls that nothing else may cover, pixels in the view; without the control `own`. */
export function controlAreas(view: DOMRect, own?: Element): Rect[] {
  return [...document.querySelectorAll(OTHERS)]
    .filter((each) => each !== own)
    .map((each) => each.getBoundingClientRect())
    .filter((box) => box.width > 0)
    .map((box) => ({
      left: box.left - view.left,
      top: box.top - view.top,
      right: box.right - view.left,
      bottom: box.bottom - view.top,
    }));
}
