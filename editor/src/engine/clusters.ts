/** Clusters: objects that are small and close together on the screen share one label with their number. Pure. */

import type { Rect } from "./labels";

/** An object on the screen, pixels: its anchor and its size. */
export interface Spot {
  id: string;
  x: number;
  y: number;
  size: number;
}

export interface Cluster {
  ids: string[];
  /** Middle of its label, pixels. */
  x: number;
  y: number;
}

/** Size on the screen from which an object has a label of its own, pixels. */
const LARGE = 110;
/** Distance from the first object of a cluster up to which others belong to it, pixels. */
const CROWD = 64;
/** Smallest number of objects of a cluster. */
const FEWEST = 3;
/** Size of a label, pixels. */
const WIDTH = 108;
const HEIGHT = 44;
/** Distance of a label from the edge of the view, pixels. */
const EDGE = 6;

/** Return the rectangle of the label of a cluster. */
export const boxOf = ({ x, y }: Cluster): Rect => ({
  left: x - WIDTH / 2,
  right: x + WIDTH / 2,
  top: y - HEIGHT / 2,
  bottom: y + HEIGHT / 2,
});

/**
 * Return the clusters of objects in a view. Their labels are inside the view. Clusters whose labels would overlap are
 * merged; a cluster whose label would overlap a `taken` rectangle is left out.
 */
export function clustersOf(spots: readonly Spot[], width: number, height: number, taken: readonly Rect[]): Cluster[] {
  const waiting = new Set(spots.filter(({ size }) => size < LARGE));
  let groups: Spot[][] = [];
  for (const first of waiting) {
    const group = [...waiting].filter(({ x, y }) => Math.hypot(x - first.x, y - first.y) <= CROWD);
    if (group.length < FEWEST) continue;
    for (const each of group) waiting.delete(each);
    groups.push(group);
  }
  const middle = (group: Spot[]): Cluster => ({
    ids: group.map(({ id }) => id),
    x: within(group.reduce((sum, { x }) => sum + x, 0) / group.length, WIDTH / 2 + EDGE, width),
    y: within(group.reduce((sum, { y }) => sum + y, 0) / group.length, HEIGHT / 2 + EDGE, height),
  });
  for (let joined = true; joined; ) {
    joined = false;
    const apart: Spot[][] = [];
    for (const group of groups) {
      const other = apart.find((each) => overlap(boxOf(middle(each)), boxOf(middle(group))));
      if (other) other.push(...group);
      else apart.push([...group]);
      joined ||= other !== undefined;
    }
    groups = apart;
  }
  return groups.map(middle).filter((each) => !taken.some((box) => overlap(box, boxOf(each))));
}

const within = (value: number, edge: number, length: number) => Math.max(edge, Math.min(value, length - edge));

export const overlap = (a: Rect, b: Rect): boolean =>
  a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
