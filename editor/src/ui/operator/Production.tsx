/** The production of the program: cycles and their durations, good and bad parts, counters. */

import { t } from "@lingui/core/macro";
import { decimal, duration } from "../../formats";
import { lastRun } from "../../program/results";
import type { RunStatistics } from "../../protocol/types";
import { useEditor } from "../../store/store";

interface Tile {
  id: string;
  name: string;
  value: string;
  tone?: "good" | "bad";
}

/** Return the numbers to show, the most important first. */
export function tilesOf(statistics: RunStatistics): Tile[] {
  const { good, bad, cycles, counters, last_cycle, mean_cycle } = statistics;
  const tiles: Tile[] = [];
  if (good !== undefined && bad !== undefined)
    tiles.push(
      { id: "good", name: t`Good`, value: decimal(good), tone: "good" },
      { id: "bad", name: t`Bad`, value: decimal(bad), ...(bad > 0 && { tone: "bad" as const }) },
    );
  tiles.push({ id: "cycles", name: t`Cycles`, value: decimal(cycles) });
  if (last_cycle !== undefined) tiles.push({ id: "last", name: t`Last cycle`, value: duration(last_cycle) });
  if (mean_cycle !== undefined) tiles.push({ id: "mean", name: t`Mean cycle`, value: duration(mean_cycle) });
  return [...tiles, ...counters.map(({ id, name, value }) => ({ id, name, value: decimal(value) }))];
}

export function Production() {
  const run = useEditor((state) => lastRun(state));
  if (!run?.statistics) return null;
  return (
    <section
      className="operator-production"
      aria-label={run.end === "running" ? t`This run` : t`Numbers of the last run`}
    >
      <h2>{run.end === "running" ? t`This run` : t`Last run`}</h2>
      <dl>
        {tilesOf(run.statistics).map(({ id, name, value, tone }) => (
          <div key={id} data-tone={tone}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}
