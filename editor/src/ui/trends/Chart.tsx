/** A chart of values with the same unit over the last minutes. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef } from "react";
import UPlot from "uplot";
import { clock, compareTexts, decimal } from "../../formats";
import { useTheme } from "../settings/Settings";
import { type Series, SPAN } from "./history";
import "uplot/dist/uPlot.min.css";
import { plotStyle } from "./plotStyle";

/** Height of a chart, pixels. */
const HEIGHT = 150;
/** Shortest shown time, s. */
const SHORTEST = 30;
const HEIGHT_BINARY = 80;
/** Colours of the lines, and their dashes for readers who do not see colours. */
export const MOST = 6;
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3], [4, 4], [14, 4]];

export function Chart({ times, series }: { times: number[]; series: Series[] }) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<UPlot | null>(null);
  const theme = useTheme();
  const key = series.map((each) => each.id).join("\n");
  const binary = series[0]?.binary ?? false;
  const data = [times, ...series.map((each) => each.values)] as UPlot.AlignedData;
  const newest = useRef(data);
  newest.current = data;
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const { colour, axis } = plotStyle(current);
    const made = new UPlot(
      {
        width: current.clientWidth,
        height: binary ? HEIGHT_BINARY : HEIGHT,
        legend: { show: false },
        cursor: { show: false },
        scales: {
          x: { range: (_, least, most) => [most - Math.min(SPAN, Math.max(SHORTEST, most - least)), most] },
          y: { range: binary ? [-0.2, 1.2] : (_, least, most) => valueRange(least, most) },
        },
        axes: [
          { ...axis, space: 90, values: (_, splits) => splits.map((each) => clock(each * 1000, true)) },
          {
            ...axis,
            size: 56,
            space: 24,
            values: (_, splits) => splits.map((each) => (binary ? binaryMark(each) : decimal(each, 6))),
          },
        ],
        series: [
          {},
          ...Array.from({ length: newest.current.length - 1 }, (_, n) => ({
            stroke: colour(`--trend-${n + 1}`),
            width: 2,
            dash: DASHES[n] ?? [],
            spanGaps: false,
            points: { show: false },
            ...(binary && UPlot.paths.stepped && { paths: UPlot.paths.stepped({ align: 1 }) }),
          })),
        ],
      },
      newest.current,
      current,
    );
    plot.current = made;
    const watch = new ResizeObserver(() => made.setSize({ width: current.clientWidth, height: made.height }));
    watch.observe(current);
    return () => {
      watch.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [key, binary, theme]);
  useEffect(() => plot.current?.setData(data));
  const names = series
    .map((each) => each.name)
    .sort(compareTexts)
    .join(", ");
  return <div ref={box} className="trend-chart" role="img" aria-label={t`${names}, last ${SPAN / 60} minutes`} />;
}

/** Return the range of the axis. A constant value is in the middle. */
function valueRange(least: number | null, most: number | null): [number, number] {
  if (least === null || most === null) return [0, 1];
  const margin = (most - least) * 0.1 || Math.max(Math.abs(most) * 0.1, 1);
  return [least - margin, most + margin];
}

const binaryMark = (value: number): string => (value === 0 || value === 1 ? String(value) : "");
