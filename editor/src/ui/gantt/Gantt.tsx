/** A Gantt chart of a run or dry run: one row for each device, with a bar for each action. */

import { t } from "@lingui/core/macro";
import { type MouseEvent, useEffect, useMemo, useRef, useState } from "react";
import { decimal, duration, fixed } from "../../formats";
import type { RunTrace, Span, TraceSummary } from "../../protocol/types";
import { Button } from "../kit/kit";
import { ShowAction } from "../run/Result";
import { type Bar, bars, byDevice, byLane, lanesIn, nearest, type RowOf, ticks } from "./layout";
import "./gantt.css";

/** Height of a bar, pixels. */
const HEIGHT = 16;
/** Smallest distance of two marks on the axis, pixels. */
const SPACE = 56;
/** Distance from an action at which a tap still finds it, pixels. */
const FINGER = 22;
const MAX_ZOOM = 4096;

interface GanttProps {
  name: string;
  trace: RunTrace;
  summary: TraceSummary;
  /** Time that is as wide as the chart, s. */
  span: number;
}

export function Gantt({ name, trace, summary, span: visible }: GanttProps) {
  const box = useRef<HTMLDivElement>(null);
  const [view, setView] = useState({ left: 0, width: 300 });
  const [zoom, setZoom] = useState(1);
  const [chosen, setChosen] = useState<Span>();
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const measure = () => setView({ left: current.scrollLeft, width: current.clientWidth });
    const watch = new ResizeObserver(measure);
    watch.observe(current);
    measure();
    return () => watch.disconnect();
  }, []);
  const scale = (zoom * view.width) / Math.max(visible, 0.001);
  const whole = Math.max(view.width, summary.whole * scale);
  // Half a screen more on both sides, so that scrolling does not show empty rows.
  const from = (view.left - view.width / 2) / scale;
  const to = (view.left + 1.5 * view.width) / scale;
  const rows = useMemo(() => bars(trace.spans, from, to, scale), [trace, from, to, scale]);
  const lanes = useMemo(() => [...lanesIn(trace.spans)], [trace]);
  const laneRows = useMemo(() => bars(trace.spans, from, to, scale, byLane), [trace, from, to, scale]);
  const shares = new Map(summary.devices.map((each) => [each.id, each.share]));
  const tap = (row: string, rowOf: RowOf) => (event: MouseEvent<SVGSVGElement>) => {
    const x = event.clientX - event.currentTarget.getBoundingClientRect().left;
    setChosen(nearest(trace.spans, row, x / scale, FINGER / scale, rowOf));
  };
  const zoomBy = (factor: number) => {
    const { current } = box;
    const next = Math.min(Math.max(zoom * factor, 1 / MAX_ZOOM), MAX_ZOOM);
    const middle = (view.left + view.width / 2) / scale;
    setZoom(next);
    // After the new width is drawn.
    requestAnimationFrame(() => {
      if (current) current.scrollLeft = (middle * next * view.width) / Math.max(visible, 0.001) - view.width / 2;
    });
  };
  return (
    <figure className="gantt">
      <figcaption>
        <span>{name}</span>
        <span className="gantt-zoom">
          <Button variant="plain" aria-label={t`Zoom out`} isDisabled={whole <= view.width} onPress={() => zoomBy(0.5)}>
            −
          </Button>
          <Button variant="plain" aria-label={t`Zoom in`} isDisabled={zoom >= MAX_ZOOM} onPress={() => zoomBy(2)}>
            +
          </Button>
        </span>
      </figcaption>
      <section
        ref={box}
        className="gantt-box"
        aria-label={t`Chart: ${name}`}
        tabIndex={0}
        onScroll={(event) => setView({ left: event.currentTarget.scrollLeft, width: event.currentTarget.clientWidth })}
      >
        <div style={{ width: whole }}>
          {trace.devices.map((device) => (
            <div key={device.id} className="gantt-row">
              <span className="gantt-device small">
                {device.name} <span className="quiet">{`${decimal((shares.get(device.id) ?? 0) * 100, 0)} %`}</span>
              </span>
              <svg
                width={whole}
                height={HEIGHT}
                role="img"
                aria-label={busyWords(device.name, device.busy)}
                onClick={tap(device.id, byDevice)}
              >
                {(rows.get(device.id) ?? []).map((bar) => (
                  <Rect
                    key={bar.span?.number ?? `at ${bar.x}`}
                    bar={bar}
                    chosen={bar.span !== undefined && bar.span === chosen}
                  />
                ))}
              </svg>
            </div>
          ))}
          {lanes.map(([id, call]) => (
            <div key={id} className="gantt-row">
              <span className="gantt-device small">
                {call} <span className="quiet">{t`branch`}</span>
              </span>
              <svg width={whole} height={HEIGHT} role="img" aria-label={t`Branch ${call}`} onClick={tap(id, byLane)}>
                {(laneRows.get(id) ?? []).map((bar) => (
                  <Rect
                    key={bar.span?.number ?? `at ${bar.x}`}
                    bar={bar}
                    chosen={bar.span !== undefined && bar.span === chosen}
                  />
                ))}
              </svg>
            </div>
          ))}
          <div className="gantt-axis small quiet" aria-hidden="true">
            {ticks(Math.max(0, from), Math.min(to, whole / scale), scale, SPACE).map((time) => (
              <span key={time} style={{ left: time * scale }}>
                {`${decimal(time, 3)} s`}
              </span>
            ))}
          </div>
        </div>
      </section>
      <p className="gantt-chosen small" aria-live="polite">
        {chosen
          ? `${chosen.name}: ${duration(chosen.duration)}, ${t`at ${fixed(chosen.start, 1)} s`}`
          : t`Tap a bar to see its action.`}
      </p>
      {chosen?.error && <p className="error small">{chosen.error}</p>}
      {chosen && <ShowAction id={chosen.action_id} />}
    </figure>
  );
}

function Rect({ bar, chosen }: { bar: Bar; chosen: boolean }) {
  return (
    <rect
      className="gantt-bar"
      data-failed={bar.failed}
      data-chosen={chosen}
      x={bar.x}
      y={1}
      width={bar.width}
      height={HEIGHT - 2}
    />
  );
}

const busyWords = (name: string, busy: number): string => t`${name}: busy for ${duration(busy)}`;
