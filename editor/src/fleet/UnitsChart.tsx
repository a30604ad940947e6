/** Good and bad units over time, as stacked bars. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef } from "react";
import UPlot from "uplot";
import { clock, decimal, shortDate } from "../formats";
import type { FleetProduction } from "../protocol/types";
import { useTheme } from "../ui/settings/Settings";
import { plotStyle } from "../ui/trends/plotStyle";
import "uplot/dist/uPlot.min.css";
import { sumOf } from "./results";

const HEIGHT = 180;
const HOUR = 3600;
const DAY = 24 * HOUR;

/** Return the bars: their start times, all units, and the good ones, which are drawn over them. */
function barsOf({ since, until, step, times }: FleetProduction): [number[], number[], number[]] {
  const known = new Map(times.map((each) => [each.at, each]));
  const [starts, all, good]: [number[], number[], number[]] = [[], [], []];
  for (let at = since; at < until; at += step) {
    const found = known.get(at);
    starts.push(at);
    good.push(found?.good ?? 0);
    all.push((found?.good ?? 0) + (found?.bad ?? 0));
  }
  return [starts, all, good];
}

export function UnitsChart({ production }: { production: FleetProduction }) {
  const box = useRef<HTMLDivElement>(null);
  const theme = useTheme();
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const { colour, axis } = plotStyle(current);
    const { since, until, step } = production;
    const bars = UPlot.paths.bars?.({ size: [0.8, 80], align: 1 });
    const bar = (name: string): UPlot.Series => ({
      stroke: colour(name),
      fill: colour(name),
      width: 0,
      points: { show: false },
      ...(bars && { paths: bars }),
    });
    const days = step > HOUR;
    const made = new UPlot(
      {
        width: current.clientWidth,
        height: HEIGHT,
        legend: { show: false },
        cursor: { show: false },
        scales: {
          x: { range: () => [since, until] },
          y: { range: (_, __, most) => [0, Math.max(1, (most ?? 0) * 1.05)] },
        },
        axes: [
          {
            ...axis,
            space: 56,
            ...(days && { incrs: [DAY, 2 * DAY] }),
            values: (_, splits) => splits.map((each) => (days ? shortDate(each * 1000) : clock(each * 1000))),
          },
          {
            ...axis,
            size: 56,
            values: (_, splits) => splits.map((each) => (Number.isInteger(each) ? decimal(each) : "")),
          },
        ],
        series: [{}, bar("--bad"), bar("--good")],
      },
      barsOf(production),
      current,
    );
    const watch = new ResizeObserver(() => made.setSize({ width: current.clientWidth, height: HEIGHT }));
    watch.observe(current);
    return () => {
      watch.disconnect();
      made.destroy();
    };
  }, [production, theme]);
  const { good, bad, rejected } = sumOf(production.counts);
  return (
    <figure className="fleet-chart">
      <div ref={box} role="img" aria-label={t`Units over time: ${good} good, ${bad + rejected} bad or rejected`} />
      <figcaption className="quiet small">
        <span data-tone="good">{t`Good`}</span>
        <span data-tone="bad">{t`Bad and rejected`}</span>
      </figcaption>
    </figure>
  );
}
