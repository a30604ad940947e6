/** Move and zoom the visible time: one finger or the mouse moves it, two fingers or the wheel zoom, a tap reads. */

import { type RefObject, useEffect, useRef } from "react";
import { moved, type Range, zoomed } from "./layout";
import { AXIS, MARGIN } from "./SignalChart";

/** Movement of a pointer up to which a press is a tap, pixels. */
const TAP = 8;
const WHEEL = 0.002;

interface Gesture {
  range: Range;
  whole: Range;
  onRange: (range: Range) => void;
  onCursor: (time: number) => void;
}

export function usePanAndZoom(box: RefObject<HTMLElement | null>, gesture: Gesture): void {
  const newest = useRef(gesture);
  newest.current = gesture;
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const pointers = new Map<number, number>();
    let travelled = 0;
    const width = () => Math.max(current.clientWidth - AXIS - MARGIN, 1);
    const timeAt = (clientX: number): number => {
      const { range } = newest.current;
      const share = (clientX - current.getBoundingClientRect().left - AXIS) / width();
      return range[0] + Math.min(Math.max(share, 0), 1) * (range[1] - range[0]);
    };
    const change = (range: Range) => {
      newest.current = { ...newest.current, range }; // the next movement may come before the next render
      newest.current.onRange(range);
    };
    const down = (event: PointerEvent) => {
      if (event.button !== 0) return;
      if (pointers.size === 0) travelled = 0;
      pointers.set(event.pointerId, event.clientX);
    };
    const move = (event: PointerEvent) => {
      const before = pointers.get(event.pointerId);
      if (before === undefined) return;
      const x = event.clientX;
      travelled += Math.abs(x - before);
      if (travelled > TAP && !current.hasPointerCapture(event.pointerId)) current.setPointerCapture(event.pointerId);
      const { range, whole } = newest.current;
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      pointers.set(event.pointerId, x);
      const perPixel = (range[1] - range[0]) / width();
      if (other === undefined) {
        if (travelled > TAP) change(moved(range, (before - x) * perPixel, whole));
        return;
      }
      const [apart, now] = [Math.abs(before - other), Math.abs(x - other)];
      if (apart > 0 && now > 0) change(zoomed(range, apart / now, timeAt((before + other) / 2), whole));
    };
    const up = (event: PointerEvent) => {
      const known = pointers.delete(event.pointerId);
      if (known && event.type === "pointerup" && pointers.size === 0 && travelled <= TAP)
        newest.current.onCursor(timeAt(event.clientX));
    };
    const wheel = (event: WheelEvent) => {
      const { range, whole } = newest.current;
      if (event.ctrlKey || event.metaKey)
        change(zoomed(range, Math.exp(event.deltaY * WHEEL), timeAt(event.clientX), whole));
      else if (event.deltaX !== 0 || event.shiftKey)
        change(moved(range, ((event.deltaX || event.deltaY) * (range[1] - range[0])) / width(), whole));
      else return; // scrolls the page
      event.preventDefault();
    };
    current.addEventListener("pointerdown", down);
    current.addEventListener("pointermove", move);
    current.addEventListener("pointerup", up);
    current.addEventListener("pointercancel", up);
    current.addEventListener("wheel", wheel, { passive: false });
    return () => {
      current.removeEventListener("pointerdown", down);
      current.removeEventListener("pointermove", move);
      current.removeEventListener("pointerup", up);
      current.removeEventListener("pointercancel", up);
      current.removeEventListener("wheel", wheel);
    };
  }, [box]);
}
