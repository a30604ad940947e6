/** Keep the graph unchanged while it is pressed; a new layout is shown after the release. */

import { type RefObject, useEffect, useRef, useState } from "react";

/** Delay after the release, ms, so that the click still hits the pressed node. */
const AFTER = 60;

/** Return the latest graph, or during a press the one at its start. */
export function usePressed<T>(host: RefObject<HTMLElement | null>, latest: T): T {
  const [pressed, setPressed] = useState(false);
  const shown = useRef(latest);
  if (!pressed) shown.current = latest;
  useEffect(() => {
    const element = host.current;
    if (!element) return;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const down = () => {
      clearTimeout(timer);
      setPressed(true);
    };
    const up = (event: Event) => {
      if (event.type === "blur" && event.target !== window) return; // of a control that loses the focus by the press
      clearTimeout(timer);
      timer = setTimeout(() => setPressed(false), AFTER);
    };
    element.addEventListener("pointerdown", down, true);
    for (const event of ["pointerup", "pointercancel", "blur"]) window.addEventListener(event, up, true);
    return () => {
      clearTimeout(timer);
      element.removeEventListener("pointerdown", down, true);
      for (const event of ["pointerup", "pointercancel", "blur"]) window.removeEventListener(event, up, true);
    };
  }, [host]);
  return shown.current;
}
