/** A chart of traces on the time axis of a recording, with the cursor and the moments of alarms. */

import { useEffect, useMemo, useRef } from "react";
import UPlot from "uplot";
import { decimal } from "../../formats";
import { useTheme } from "../settings/Settings";
import { columns, type Range, STEP, type Trace } from "./layout";
import "uplot/dist/uPlot.min.css";
import { plotStyle } from "../trends/plotStyle";

/** Width of the axis of values, and of the space on the right, pixels. The lanes of actions have the same. */
export const AXIS = 76;
export const MARGIN = 10;
const HEIGHT = 150;
/** Height of the axis of time, of a digital trace, and of the space above it, pixels. */
const TIMES = 34;
const ROW = 30;
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3], [4, 4], [14, 4]];

interface SignalChartProps {
  traces: readonly Trace[];
  whole: Range;
  range: Range;
  cursor: number;
  alarms: readonly number[];
  label: string;
}

export function SignalChart({ traces, whole, range, cursor, alarms, label }: SignalChartProps) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<UPlot | null>(null);
  const theme = useTheme();
  const digital = traces[0]?.digital ?? false;
  const data = useMemo(() => columns(traces, whole) as UPlot.AlignedData, [traces, whole]);
  const marks = useRef({ cursor, alarms, range });
  marks.current = { cursor, alarms, range };
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const { colour, axis } = plotStyle(current);
    const lines = { alarm: colour("--bad"), cursor: colour("--focus") };
    const made = new UPlot(
      {
        width: current.clientWidth,
        height: digital ? traces.length * ROW + TIMES + 8 : HEIGHT,
        padding: [8, MARGIN, 0, 0],
        legend: { show: false },
        cursor: { show: false },
        scales: {
          x: { time: false, range: () => [marks.current.range[0] / 1000, marks.current.range[1] / 1000] },
          y: { range: digital ? [-0.2, traces.length * STEP - 0.3] : rangeOf(traces) },
        },
        axes: [
          { ...axis, space: 60, values: (_, splits) => splits.map((each) => `${decimal(each, 3)} s`) },
          {
            ...axis,
            size: AXIS,
            space: 24,
            ...(digital
              ? { splits: traces.map((_, n) => n * STEP), values: () => [] }
              : { values: (_: UPlot, splits: number[]) => splits.map((each) => decimal(each, 6)) }),
          },
        ],
        series: [
          {},
          ...traces.map((_, n) => ({
            stroke: colour(`--trend-${n + 1}`),
            width: 2,
            dash: digital ? [] : (DASHES[n] ?? []),
            spanGaps: false,
            points: { show: false },
            ...(digital && UPlot.paths.stepped && { paths: UPlot.paths.stepped({ align: 1 }) }),
          })),
        ],
        hooks: {
          draw: [
            (drawn) => {
              line(drawn, marks.current.cursor, lines.cursor, []);
              for (const each of marks.current.alarms) line(drawn, each, lines.alarm, [6, 6]);
            },
          ],
        },
      },
      data,
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
  }, [data, digital, traces, theme]);
  useEffect(() => {
    plot.current?.setScale("x", { min: range[0] / 1000, max: range[1] / 1000 });
  }, [range]);
  useEffect(() => plot.current?.redraw(false), [cursor, alarms]);
  return <div ref={box} className="trend-chart" role="img" aria-label={label} />;
}

/** Draw a vertical line at a time, ms. */
function line(plot: UPlot, time: number, colour: string, dash: number[]): void {
  const x = Math.round(plot.valToPos(time / 1000, "x", true));
  const { left, top, width, height } = plot.bbox;
  if (x < left || x > left + width) return;
  const { ctx } = plot;
  ctx.save();
  ctx.strokeStyle = colour;
  ctx.lineWidth = 2 * devicePixelRatio;
  ctx.setLineDash(dash.map((each) => each * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(x, top);
  ctx.lineTo(x, top + height);
  ctx.stroke();
  ctx.restore();
}

/** Return the range of the axis, which does not depend on the visible time. A constant value is in the middle. */
function rangeOf(traces: readonly Trace[]): [number, number] {
  const values = traces.flatMap((each) => each.values).filter((each) => each !== null);
  if (values.length === 0) return [0, 1];
  const [least, most] = values.reduce(([a, b], each) => [Math.min(a, each), Math.max(b, each)], [Infinity, -Infinity]);
  const margin = (most - least) * 0.1 || Math.max(Math.abs(most) * 0.1, 1);
  return [least - margin, most + margin];
}
