/** A tall graph in columns next to each other, as many as fit into the view at a readable size. Pure functions. */

import type { Box, Line } from "./graph";
import { READABLE } from "./viewport";

/** Space between columns, where the connections from one to the next are drawn, and above them. */
const GAP = 64;
const ABOVE = 24;
/** Distance of connections above the columns from each other. */
const LANE = 8;
/** Space of the view that controls cover, pixels. */
const COVERED = { width: 90, height: 90 };
/** Most connections that a cut may cross, and the part of a column by which it may be longer or shorter. */
const CROSSING = 3;
const SLACK = 0.3;

export interface Graph {
  boxes: Box[];
  lines: Line[];
}

/** The bends of a connection to another column: right of its start, above the columns, left of its end. */
export interface Detour {
  right: number;
  above: number;
  left: number;
}

interface Wrapped extends Graph {
  /** Detours of connections by their ids. */
  detours: Map<string, Detour>;
}

interface Cut {
  y: number;
  crossing: number;
}

/** Return a graph that is readable in a view of this size, pixels, with less scrolling. */
export function inColumns({ boxes, lines }: Graph, view: { width: number; height: number }): Wrapped {
  const none: Wrapped = { boxes, lines, detours: new Map() };
  if (boxes.length === 0 || view.width === 0) return none;
  const top = Math.min(...boxes.map((each) => each.y));
  const tall = Math.max(...boxes.map((each) => each.y + each.height)) - top;
  const free = {
    width: (view.width - COVERED.width) / READABLE,
    height: (view.height - COVERED.height) / READABLE,
  };
  const cuts = cutsOf(boxes, lines);
  const most = Math.floor((free.width + GAP) / (Math.min(...boxes.map((each) => each.width)) + GAP));
  for (let count = Math.min(most, Math.ceil(tall / Math.max(1, free.height))); count > 1; count--) {
    const chosen = chooseCuts(cuts, top, tall, count);
    if (!chosen) continue;
    const columns = split(boxes, chosen);
    const width = columns.reduce((sum, each) => sum + widthOf(each), 0) + GAP * (count - 1);
    if (width <= free.width) return arranged(columns, lines);
  }
  return none;
}

/** Return the heights between rows of nodes, and how many connections cross them. */
function cutsOf(boxes: readonly Box[], lines: readonly Line[]): Cut[] {
  const byTop = [...boxes].sort((a, b) => a.y - b.y);
  const place = new Map(boxes.map((each) => [each.id, each.y]));
  const found: Cut[] = [];
  let bottom = -Infinity;
  for (const box of byTop) {
    if (box.y > bottom && bottom > -Infinity) found.push({ y: (bottom + box.y) / 2, crossing: 0 });
    bottom = Math.max(bottom, box.y + box.height);
  }
  for (const { from, to } of lines) {
    const [start = 0, end = 0] = [place.get(from), place.get(to)];
    for (let n = firstAfter(found, start); n < found.length && (found[n] as Cut).y < end; n++)
      (found[n] as Cut).crossing++;
  }
  return found;
}

function firstAfter(cuts: readonly Cut[], y: number): number {
  let [low, high] = [0, cuts.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((cuts[middle] as Cut).y > y) high = middle;
    else low = middle + 1;
  }
  return low;
}

/** Return the cuts into columns of similar heights that cross the fewest connections; null if there are none. */
function chooseCuts(cuts: readonly Cut[], top: number, tall: number, count: number): number[] | null {
  const height = tall / count;
  const found: number[] = [];
  for (let n = 1; n < count; n++) {
    const wanted = top + n * height;
    const near = cuts.filter((each) => Math.abs(each.y - wanted) <= SLACK * height && each.crossing <= CROSSING);
    const cost = (each: Cut) => each.crossing + Math.abs(each.y - wanted) / height;
    const [first, ...others] = near;
    if (!first) return null;
    found.push(others.reduce((best, each) => (cost(each) < cost(best) ? each : best), first).y);
  }
  return found;
}

function split(boxes: readonly Box[], cuts: readonly number[]): Box[][] {
  const columns: Box[][] = Array.from({ length: cuts.length + 1 }, () => []);
  for (const box of boxes) columns[cuts.filter((each) => each < box.y).length]?.push(box);
  return columns;
}

const leftOf = (boxes: readonly Box[]): number => Math.min(...boxes.map((each) => each.x));
const widthOf = (boxes: readonly Box[]): number =>
  Math.max(...boxes.map((each) => each.x + each.width)) - leftOf(boxes);

function arranged(columns: readonly Box[][], lines: readonly Line[]): Wrapped {
  const column = new Map<string, number>();
  const lefts: number[] = [];
  const boxes: Box[] = [];
  let x = 0;
  columns.forEach((each, n) => {
    const left = leftOf(each);
    const top = Math.min(...each.map((box) => box.y));
    lefts.push(x);
    for (const box of each) {
      column.set(box.id, n);
      boxes.push({ ...box, x: box.x - left + x, y: box.y - top });
    }
    x += widthOf(each) + GAP;
  });
  const detours = new Map<string, Detour>();
  const lane = () => (detours.size % 4) * LANE;
  for (const { id, from, to } of lines) {
    const [start, end] = [column.get(from) ?? 0, column.get(to) ?? 0];
    if (start === end) continue;
    const at = lane();
    detours.set(id, {
      right: (lefts[start + 1] ?? x) - GAP / 2 - at,
      above: -ABOVE - at,
      left: (lefts[end] ?? 0) - GAP / 2 - at,
    });
  }
  return { boxes, lines: [...lines], detours };
}
