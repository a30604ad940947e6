/** Position and direction of the arrow at the edge of a view. */

export interface Rect {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

/**
 * Half size of the arrow, distance between tried positions, and distance from the edge at first and further inside,
 * pixels.
 */
const HALF = 22;
const STEP = 11;
const INSETS = [34, 104, 174];

/**
 * Return the middle of an arrow towards a point outside the view so that it covers no control, and its angle in
 * degrees: 0 to the right, 90 down. It is moved along the edge as little as possible, or inwards.
 */
export function atEdge(
  to: { x: number; y: number },
  width: number,
  height: number,
  taken: readonly Rect[],
): { x: number; y: number; angle: number } {
  const [dx, dy] = [to.x - width / 2, to.y - height / 2];
  const angle = (Math.atan2(dy, dx) * 180) / Math.PI;
  const free = ({ x, y }: { x: number; y: number }) =>
    !taken.some(
      (each) => x + HALF > each.left && x - HALF < each.right && y + HALF > each.top && y - HALF < each.bottom,
    );
  let first: { x: number; y: number } | null = null;
  for (const inset of INSETS) {
    const [wide, tall] = [Math.max(1, width / 2 - inset), Math.max(1, height / 2 - inset)];
    const scale = Math.min(wide / Math.max(1e-6, Math.abs(dx)), tall / Math.max(1e-6, Math.abs(dy)));
    const start = { x: width / 2 + dx * scale, y: height / 2 + dy * scale };
    first ??= start;
    const upright = Math.abs(dx) * scale >= wide - 1e-6; // at the left or right edge
    for (let by = 0; by <= (upright ? height : width); by += STEP) {
      for (const side of [1, -1]) {
        const place = upright ? { x: start.x, y: start.y + side * by } : { x: start.x + side * by, y: start.y };
        const inside = upright ? Math.abs(place.y - height / 2) <= tall : Math.abs(place.x - width / 2) <= wide;
        if (inside && free(place)) return { ...place, angle };
      }
    }
  }
  return { x: first?.x ?? 0, y: first?.y ?? 0, angle };
}
