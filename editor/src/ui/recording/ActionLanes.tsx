/** The actions of a recording as bands with names, one lane for each device. */

import { t } from "@lingui/core/macro";
import type { RecordedAction } from "../../commands/recordings";
import type { Lane, Range } from "./layout";

const ROW = 22;
/** Width below which a band has no name, % of the visible time. */
const NARROW = 2;

interface ActionLanesProps {
  lanes: readonly Lane[];
  range: Range;
  end: number;
  cursor: number;
  alarms: readonly number[];
}

export function ActionLanes({ lanes, range: [from, to], end, cursor, alarms }: ActionLanesProps) {
  const at = (time: number) => ((time - from) / (to - from)) * 100;
  const inside = (time: number) => time >= from && time <= to;
  return (
    <section className="recorded-actions" aria-label={t`Actions`}>
      {lanes.map((lane) => (
        <div key={lane.name} className="recorded-lane">
          <span className="small quiet" title={lane.name}>
            {lane.name || t`Program`}
          </span>
          <div className="recorded-track" style={{ height: lane.rows * ROW }}>
            {lane.bands
              .filter(({ action }) => action.begin <= to && (action.end ?? end) >= from)
              .map(({ action, row }) => {
                const left = Math.max(at(action.begin), 0);
                const width = Math.min(at(action.end ?? end), 100) - left;
                return (
                  <span
                    key={action.number}
                    className="recorded-band small"
                    data-failed={action.error !== undefined}
                    data-running={action.end === undefined}
                    title={action.name}
                    style={{ left: `${left}%`, width: `${width}%`, top: row * ROW, height: ROW - 2 }}
                  >
                    {width > NARROW && action.name}
                  </span>
                );
              })}
            {inside(cursor) && <span className="recorded-cursor" style={{ left: `${at(cursor)}%` }} />}
            {alarms.filter(inside).map((time) => (
              <span key={time} className="recorded-alarm" style={{ left: `${at(time)}%` }} />
            ))}
          </div>
        </div>
      ))}
    </section>
  );
}

/** Return in words how an action ended. */
export function outcome(action: RecordedAction): string {
  if (action.error !== undefined) return t`failed`;
  if (action.end === undefined) return t`not ended`;
  return action.results?.join(", ") ?? "";
}
