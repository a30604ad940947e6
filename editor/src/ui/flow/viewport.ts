/** Which part of the graph is shown, in the coordinates of React Flow. Pure functions. */

export interface Rect {
  x: number;
  y: number;
  width: number;
  height: number;
}

interface Viewport {
  x: number;
  y: number;
  zoom: number;
}

type Size = Pick<Rect, "width" | "height">;

/** Smallest zoom at which the graph opens: the small text of a node has 11 pixels. */
export const READABLE = 0.85;
export const SMALLEST = 0.15;
const LARGEST = 1.1;
/** Space for the controls above and next to the graph. */
const MARGIN = { top: 70, right: 16, bottom: 16, left: 70 };

/** Return the view that shows the whole graph. */
export function wholeView(boxes: readonly Rect[], { width, height }: Size): Viewport {
  const left = Math.min(...boxes.map((each) => each.x));
  const top = Math.min(...boxes.map((each) => each.y));
  const wide = Math.max(...boxes.map((each) => each.x + each.width)) - left;
  const tall = Math.max(...boxes.map((each) => each.y + each.height)) - top;
  const free = { width: width - MARGIN.left - MARGIN.right, height: height - MARGIN.top - MARGIN.bottom };
  const zoom = Math.max(SMALLEST, Math.min(LARGEST, free.width / wide, free.height / tall));
  return {
    x: MARGIN.left + (free.width - wide * zoom) / 2 - left * zoom,
    y: MARGIN.top + (free.height - tall * zoom) / 2 - top * zoom,
    zoom,
  };
}

/**
 * Return the first view: the whole graph if it stays readable, otherwise its start at the upper edge. All columns are
 * shown if they fit.
 */
export function firstView(boxes: readonly Rect[], start: Rect | undefined, size: Size): Viewport {
  const whole = wholeView(boxes, size);
  if (whole.zoom >= READABLE || !start) return whole;
  const left = Math.min(...boxes.map((each) => each.x));
  const wide = (Math.max(...boxes.map((each) => each.x + each.width)) - left) * READABLE;
  const free = size.width - MARGIN.left - MARGIN.right;
  const x =
    wide <= free
      ? MARGIN.left + (free - wide) / 2 - left * READABLE
      : size.width / 2 - (start.x + start.width / 2) * READABLE;
  return { x, y: MARGIN.top - start.y * READABLE, zoom: READABLE };
}

/**
 * Return the view that shows a node in the middle; null if it is shown already. With `readable`, a node that is shown
 * at a small size is enlarged.
 */
export function viewOf(box: Rect, now: Viewport, { width, height }: Size, readable = false): Viewport | null {
  const [left, top] = [box.x * now.zoom + now.x, box.y * now.zoom + now.y];
  const inside = left >= 0 && top >= 0 && left + box.width * now.zoom <= width && top + box.height * now.zoom <= height;
  if (inside && (!readable || now.zoom >= READABLE / 2)) return null;
  const zoom = readable ? Math.max(READABLE, now.zoom) : now.zoom;
  return {
    x: width / 2 - (box.x + box.width / 2) * zoom,
    y: height * 0.45 - (box.y + box.height / 2) * zoom,
    zoom,
  };
}
