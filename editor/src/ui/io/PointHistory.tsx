/** The history of a point over an hour, a day or a week, with export; a separate chunk. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import UPlot from "uplot";
import { exportPoint, findPoint, type HistoryPoint, loadSummary, type PointSummary } from "../../commands/history";
import { refusal, sentence } from "../../commands/requests";
import { clock, decimal } from "../../formats";
import { shownUnit } from "../../program/values";
import { ModalDialog } from "../kit/dialogs";
import { ToggleGroup } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { useTheme } from "../settings/Settings";
import { useVisible } from "../useVisible";
import { aloneIn, BUCKETS, columnsOf, overall, pauseOf, SPANS, type Span } from "./history";
import { valueText } from "./points";
import "uplot/dist/uPlot.min.css";
import "../trends/trends.css";
import "./history.css";
import { plotStyle } from "../trends/plotStyle";

const HEIGHT = 260;
const DAY = 86_400;
/** Diameter of a value without a neighbour, pixels. */
const DOT = 6;

interface PointHistoryProps {
  objectId: string;
  device: string;
  /** Name of the point as the device reports it, and as it is shown. */
  id: string;
  name: string;
  unit: string;
  onClose: () => void;
}

export default function PointHistory({ objectId, device, id, name, unit, onClose }: PointHistoryProps) {
  const [span, setSpan] = useState<Span>("hour");
  const [point, setPoint] = useState<HistoryPoint | null>(null);
  const [summary, setSummary] = useState<PointSummary | null>(null);
  const [failed, setFailed] = useState("");
  const { refused, busy, ask } = useRefusal();
  const visible = useVisible();
  useEffect(() => setSummary(null), [objectId, id, span]);
  useEffect(() => {
    if (!visible) return;
    let open = true;
    let next = 0;
    const load = async () => {
      const found = await findPoint(objectId, id);
      if (!found) throw new Error(t`This point has not been recorded yet.`);
      const loaded = await loadSummary(found.number, SPANS[span], BUCKETS);
      if (!open) return;
      setPoint(found);
      setSummary(loaded);
      setFailed("");
    };
    const follow = () =>
      load()
        .catch((error: unknown) => open && setFailed(sentence(error)))
        .finally(() => {
          if (open) next = window.setTimeout(follow, pauseOf(span));
        });
    follow();
    return () => {
      open = false;
      window.clearTimeout(next);
    };
  }, [objectId, id, span, visible]);
  const output = `${device}: ${name}`;
  const save = () => exportPoint(point?.number ?? 0, SPANS[span], `${device} ${name}`);
  return (
    <ModalDialog title={t`History of ${output}`} onClose={onClose}>
      <div className="point-history">
        <ToggleGroup
          label={t`Period`}
          quiet
          value={span}
          choices={[
            ["hour", t`1 hour`],
            ["day", t`1 day`],
            ["week", t`1 week`],
          ]}
          onChange={setSpan}
        />
        {point && summary && <Content summary={summary} digital={point.digital} unit={unit} label={output} />}
        {!summary && !failed && <Waiting>{t`Loading…`}</Waiting>}
        <RefusedText>{failed || refused}</RefusedText>
      </div>
      <div className="actions">
        <Button icon="save" isDisabled={busy || !summary} onPress={() => void ask(refusal(save))}>
          {t`Export CSV`}
        </Button>
        <Button variant="primary" onPress={onClose} autoFocus>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}

interface ContentProps {
  summary: PointSummary;
  digital: boolean;
  unit: string;
  label: string;
}

function Content({ summary, digital, unit, label }: ContentProps) {
  const all = overall(summary);
  if (!all) return <p className="quiet">{t`No value was known in this period.`}</p>;
  const [lowest, mean, highest] = all;
  const share = `${decimal(mean * 100, 1)}\u00a0%`;
  return (
    <>
      <p className="point-history-facts">
        {digital ? (
          <span>{t`On for ${share} of the known time`}</span>
        ) : (
          <>
            <Fact label={t`Lowest`} value={valueText(lowest, unit)} />
            <Fact label={t`Mean`} value={valueText(mean, unit)} />
            <Fact label={t`Highest`} value={valueText(highest, unit)} />
          </>
        )}
      </p>
      <Chart summary={summary} digital={digital} unit={unit} label={label} />
      {!digital && (
        <p className="quiet small">{t`The line is the mean, the band behind it the lowest and the highest value.`}</p>
      )}
    </>
  );
}

function Fact({ label, value }: { label: string; value: string }) {
  return (
    <span>
      <span className="quiet">{label}</span> <strong>{value}</strong>
    </span>
  );
}

function Chart({ summary, digital, unit, label }: ContentProps) {
  const box = useRef<HTMLDivElement>(null);
  const chart = useRef<UPlot>(null);
  const shown = useRef(summary);
  shown.current = summary;
  const theme = useTheme();
  const days = (summary.until - summary.since) / 1000 > DAY;
  const [unitShown, factor] = digital ? ["", 1] : shownUnit("double", { unit });
  useEffect(() => {
    const { current } = box;
    if (!current) return;
    const { colour, axis } = plotStyle(current);
    const line = { points: { show: false }, spanGaps: false };
    const dots = {
      show: false,
      filter: (plot: UPlot, n: number) => aloneIn(plot.data[n] ?? []),
      size: DOT,
      fill: colour("--trend-1"),
    };
    const edge = { ...line, show: !digital, stroke: `${colour("--trend-1")}66`, width: 1 };
    const made = new UPlot(
      {
        width: current.clientWidth,
        height: HEIGHT,
        legend: { show: false },
        cursor: { show: false },
        scales: {
          x: { range: () => [shown.current.since / 1000, shown.current.until / 1000] },
          y: digital ? { range: [-0.05, 1.05] } : { range: (_, least, most) => valueRange(least, most) },
        },
        axes: [
          { ...axis, space: 80, values: (_, splits) => splits.map((each) => (days ? day(each) : clock(each * 1000))) },
          {
            ...axis,
            size: 68,
            space: 28,
            values: (_, splits) => splits.map((each) => (digital ? `${decimal(each * 100, 0)} %` : decimal(each, 6))),
            ...(unitShown && { label: unitShown, labelSize: 20, labelFont: axis.font }),
          },
        ],
        series: [{}, { ...line, stroke: colour("--trend-1"), width: 2, points: dots }, edge, edge],
        bands: digital ? [] : [{ series: [3, 2], fill: `${colour("--trend-1")}33` }],
      },
      columnsOf(shown.current, factor) as UPlot.AlignedData,
      current,
    );
    chart.current = made;
    const watch = new ResizeObserver(() => made.setSize({ width: current.clientWidth, height: HEIGHT }));
    watch.observe(current);
    return () => {
      watch.disconnect();
      chart.current = null;
      made.destroy();
    };
  }, [days, digital, unitShown, factor, theme]);
  useEffect(() => chart.current?.setData(columnsOf(summary, factor) as UPlot.AlignedData), [summary, factor]);
  return <div ref={box} className="trend-chart" role="img" aria-label={label} />;
}

/** Return the range of the axis. A constant value is in the middle. */
function valueRange(least: number | null, most: number | null): [number, number] {
  if (least === null || most === null) return [0, 1];
  const margin = (most - least) * 0.1 || Math.max(Math.abs(most) * 0.1, 1);
  return [least - margin, most + margin];
}

const day = (seconds: number): string =>
  new Date(seconds * 1000).toLocaleDateString(document.documentElement.lang, { day: "numeric", month: "numeric" });
