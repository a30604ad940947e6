/** A graph under a finger stands still: what is laid out anew meanwhile is shown when the finger is off. */

import { type RefObject, useEffect, useRef, useState } from "react";

/** ms after the finger is off, so that the click that comes of it still meets what was pressed. */
const AFTER = 60;

/** Give the latest graph, but the one that was shown when a press began as long as that lasts. */
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
      if (event.type === "blur" && event.target !== window) return; // of a control, which loses the focus by the press
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
