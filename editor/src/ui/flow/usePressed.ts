/**
 * Keep the graph unchanged while it is pressed; a new layout is shown after the release. A tap counts for the pressed
 * node.
 */

import { type RefObject, useEffect, useRef, useState } from "react";

/** Delay after the release, ms, so that the click still hits the pressed node. */
const AFTER = 60;

/**
 * Return the latest graph, or during a press the one at its start.
 *
 * `tapped` is called for a node that moved away from under the press: the graph draws its nodes one frame late, so a
 * layout from before the press can arrive after it.
 */
export function usePressed<T>(host: RefObject<HTMLElement | null>, latest: T, tapped: (id: string) => void): T {
  const [pressed, setPressed] = useState(false);
  const shown = useRef(latest);
  const onTap = useRef(tapped);
  onTap.current = tapped;
  if (!pressed) shown.current = latest;
  useEffect(() => {
    const element = host.current;
    if (!element) return;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let node: string | undefined;
    const nodeOf = (event: Event) =>
      event.target instanceof Element ? event.target.closest<HTMLElement>(".react-flow__node")?.dataset.id : undefined;
    const down = (event: Event) => {
      clearTimeout(timer);
      setPressed(true);
      node = nodeOf(event);
    };
    const click = (event: Event) => {
      // The target of a click is the nearest common ancestor of the elements at the start and the end of the press.
      if (node === undefined || nodeOf(event) !== undefined) return;
      event.stopPropagation();
      onTap.current(node);
    };
    const up = (event: Event) => {
      if (event.type === "blur" && event.target !== window) return; // of a control that loses the focus by the press
      clearTimeout(timer);
      timer = setTimeout(() => setPressed(false), AFTER);
    };
    element.addEventListener("pointerdown", down, true);
    element.addEventListener("click", click, true);
    for (const event of ["pointerup", "pointercancel", "blur"]) window.addEventListener(event, up, true);
    return () => {
      clearTimeout(timer);
      element.removeEventListener("pointerdown", down, true);
      element.removeEventListener("click", click, true);
      for (const event of ["pointerup", "pointercancel", "blur"]) window.removeEventListener(event, up, true);
    };
  }, [host]);
  return shown.current;
}
