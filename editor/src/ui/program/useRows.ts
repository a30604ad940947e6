/** The rows of a list in the panel that are rendered. */

import { type RefObject, useCallback, useLayoutEffect, useMemo, useRef, useState } from "react";

/** Rows up to this distance from the view are rendered too, pixels; the distance is rounded to steps of this size. */
const AHEAD = 600;
/** Longer lists render only the rows in view. */
const MANY = 200;
const STEP = 100;

/** Return the position of the upper edge of a row; for the index after the last row, the height of the list. */
export const at = (tops: Float64Array, index: number): number => tops[index] ?? 0;

/** Return the first row whose lower edge is below a place. */
function rowAt(tops: Float64Array, place: number): number {
  let [low, high] = [0, tops.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (at(tops, middle + 1) > place) high = middle;
    else low = middle + 1;
  }
  return low;
}

export interface Rows {
  tops: Float64Array;
  /** Range of the rendered rows: first index, and the index after the last one. */
  first: number;
  last: number;
  /** Scroll a row into the view. */
  show: (index: number) => void;
}

/** Lay out rows with these heights, in pixels at the usual text size, in the list within the panel. */
export function useRows(list: RefObject<HTMLElement | null>, heights: readonly number[]): Rows {
  const key = heights.join();
  const scale = Number.parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
  const tops = useMemo(() => {
    const found = new Float64Array(heights.length + 1);
    heights.forEach((height, n) => {
      found[n + 1] = at(found, n) + height * scale;
    });
    return found;
  }, [key, scale]);
  const [view, setView] = useState({ from: 0, to: 2 * AHEAD });
  const empty = heights.length === 0;
  useLayoutEffect(() => {
    const host = list.current?.closest(".panel-body");
    if (!host) return;
    const updateView = () => {
      const start = list.current?.getBoundingClientRect().top ?? 0;
      const { top, bottom } = host.getBoundingClientRect();
      const from = Math.floor((top - start - AHEAD) / STEP) * STEP;
      const to = Math.ceil((bottom - start + AHEAD) / STEP) * STEP;
      setView((known) => (known.from === from && known.to === to ? known : { from, to }));
    };
    updateView();
    const observer = new ResizeObserver(updateView);
    observer.observe(host);
    host.addEventListener("scroll", updateView, { passive: true });
    return () => {
      observer.disconnect();
      host.removeEventListener("scroll", updateView);
    };
  }, [list, empty]);
  const latest = useRef(tops);
  latest.current = tops;
  const show = useCallback(
    (index: number) => {
      const host = list.current?.closest(".panel-body");
      if (!host || !list.current) return;
      const box = host.getBoundingClientRect();
      const start = list.current.getBoundingClientRect().top;
      const [top, bottom] = [start + at(latest.current, index), start + at(latest.current, index + 1)];
      if (top >= box.top && bottom <= box.bottom) return;
      host.scrollTop += (top + bottom) / 2 - (box.top + box.bottom) / 2;
    },
    [list],
  );
  const count = heights.length;
  if (count <= MANY) return { tops, first: 0, last: count, show };
  return { tops, first: rowAt(tops, view.from), last: Math.min(count, rowAt(tops, view.to) + 1), show };
}
