/** A connection to another column: between the columns, and above those that it passes. */

import { BaseEdge, type Edge, type EdgeProps, Position } from "@xyflow/react";
import type { Detour } from "./columns";

type WrappedEdgeType = Edge<{ detour: Detour }, "wrapped">;

/** Distance from a node to the first bend, and radius of bends. */
const OUT = 20;
const RADIUS = 8;

export function WrappedEdge({
  sourceX,
  sourceY,
  sourcePosition,
  targetX,
  targetY,
  data,
  style,
  markerEnd,
  label,
  interactionWidth,
}: EdgeProps<WrappedEdgeType>) {
  if (!data) return null;
  const { right, above, left } = data.detour;
  const aside = sourcePosition === Position.Right;
  const high = right === left ? targetY - OUT : above;
  const points: [number, number][] = [
    [sourceX, sourceY],
    ...(aside ? [] : [[sourceX, sourceY + OUT] as [number, number]]),
    [right, aside ? sourceY : sourceY + OUT],
    [right, high],
    ...(right === left
      ? []
      : ([
          [left, high],
          [left, targetY - OUT],
        ] as [number, number][])),
    [targetX, targetY - OUT],
    [targetX, targetY],
  ];
  return (
    <BaseEdge
      path={rounded(points)}
      label={label}
      labelX={right}
      labelY={aside ? sourceY : sourceY + OUT}
      {...(style && { style })}
      {...(markerEnd !== undefined && { markerEnd })}
      {...(interactionWidth !== undefined && { interactionWidth })}
    />
  );
}

/** Return a line through points as an SVG path with rounded corners. */
function rounded(points: readonly [number, number][]): string {
  const towards = ([x, y]: [number, number], [toX, toY]: [number, number]): string => {
    const length = Math.hypot(toX - x, toY - y) || 1;
    const part = Math.min(RADIUS, length / 2) / length;
    return `${x + (toX - x) * part} ${y + (toY - y) * part}`;
  };
  return points
    .map((point, n) => {
      const [before, after] = [points[n - 1], points[n + 1]];
      if (!before) return `M ${point.join(" ")}`;
      if (!after) return `L ${point.join(" ")}`;
      return `L ${towards(point, before)} Q ${point.join(" ")} ${towards(point, after)}`;
    })
    .join(" ");
}
