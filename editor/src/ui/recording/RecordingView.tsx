/** A recording: points and joints over time, actions as bands, and all values at a cursor. A separate chunk. */

import { plural, t } from "@lingui/core/macro";
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { exportRecording, loadRecording, type Recording, type Signal } from "../../commands/recordings";
import { refusal, sentence } from "../../commands/requests";
import { dateAndTime, decimal, fixed } from "../../formats";
import { translate } from "../../i18n/serverMessages";
import { splitAddress } from "../../program/messages";
import type { RecordingChangedData } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { ModalDialog } from "../kit/dialogs";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { MOST } from "../trends/Chart";
import { ActionLanes, outcome } from "./ActionLanes";
import {
  changes,
  charts,
  idOf,
  lanes as lanesOf,
  nameOf,
  type Range,
  runningAt,
  shownAtFirst,
  type Trace,
  traceOf,
  valueAt,
  zoomed,
} from "./layout";
import { SignalChart } from "./SignalChart";
import { usePanAndZoom } from "./usePanAndZoom";
import { useRecordingChanges } from "./useRecordings";
import "../trends/trends.css";
import "./recording.css";

const NO_RANGE: Range = [-1, 0];

export default function RecordingView({ number, onClose }: { number: number; onClose: () => void }) {
  const [recording, setRecording] = useState<Recording | null>(null);
  const [failed, setFailed] = useState("");
  const { refused, busy, ask } = useRefusal();
  const load = useCallback(() => {
    loadRecording(number).then(setRecording, (error: unknown) => setFailed(sentence(error)));
  }, [number]);
  useEffect(load, [load]);
  // A recording continues for some seconds after the event.
  const reload = useCallback(
    (changed: RecordingChangedData) => {
      if (changed.recording.number === number) load();
    },
    [number, load],
  );
  useRecordingChanges(reload);
  return (
    <ModalDialog title={recording ? t`Recording of ${dateAndTime(recording.at)}` : t`Recording`} onClose={onClose}>
      <div className="recording">
        {recording && <Content recording={recording} />}
        {!recording && !failed && <Waiting>{t`Loading…`}</Waiting>}
        <RefusedText>{failed || refused}</RefusedText>
      </div>
      <div className="actions">
        <Button
          icon="save"
          isDisabled={busy || !recording}
          onPress={() => void ask(refusal(() => exportRecording(number)))}
        >
          {t`Export CSV`}
        </Button>
        <Button variant="primary" onPress={onClose} autoFocus>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}

function Content({ recording }: { recording: Recording }) {
  const { begin, end, signals, actions } = recording;
  const [shown, setShown] = useState(() => shownAtFirst(recording));
  const [range, setRange] = useState<Range>([begin, end]);
  const [cursor, setCursor] = useState(0);
  const box = useRef<HTMLDivElement>(null);
  const whole = useMemo<Range>(() => (end > begin ? [begin, end] : NO_RANGE), [begin, end]);
  useEffect(() => setRange(whole), [whole]);
  usePanAndZoom(box, { range, whole, onRange: setRange, onCursor: setCursor });
  const groups = useMemo(
    () =>
      charts(
        signals.filter((each) => shown.has(idOf(each))).map((each) => traceOf(each, unitOf(each))),
        MOST,
      ),
    [signals, shown],
  );
  const lanes = useMemo(() => lanesOf(actions, end), [actions, end]);
  const moments = useMemo(() => [...new Set([0, ...recording.alarms.map((each) => each.time)])], [recording]);
  const running = runningAt(actions, cursor);
  const zoom = (factor: number) => {
    const middle = cursor >= range[0] && cursor <= range[1] ? cursor : (range[0] + range[1]) / 2;
    setRange(zoomed(range, factor, middle, whole));
  };
  return (
    <>
      <Facts recording={recording} />
      <Chooser signals={signals} shown={shown} onChange={setShown} />
      <div className="recording-cursor">
        <label>
          <span>
            {t`Values at`} <strong>{seconds(cursor)}</strong>
          </span>
          <input
            type="range"
            min={whole[0]}
            max={whole[1]}
            step={10}
            value={cursor}
            onChange={(event) => setCursor(Number(event.target.value))}
          />
        </label>
        <Button variant="plain" aria-label={t`Zoom out`} onPress={() => zoom(2)}>
          −
        </Button>
        <Button variant="plain" aria-label={t`Zoom in`} onPress={() => zoom(0.5)}>
          +
        </Button>
        <Button variant="plain" onPress={() => setRange(whole)}>{t`Everything`}</Button>
      </div>
      <p className="recording-running small" aria-live="off">
        {running.length === 0 && <span className="quiet">{t`No action was running.`}</span>}
        {running.map((each) => (
          <span key={each.number} data-failed={each.error !== undefined}>
            <strong>{each.object_name ? `${each.object_name}: ${each.name}` : each.name}</strong>{" "}
            <span className="quiet">{outcome(each)}</span>
          </span>
        ))}
      </p>
      <div className="recording-plots" ref={box}>
        {lanes.length > 0 && <ActionLanes lanes={lanes} range={range} end={end} cursor={cursor} alarms={moments} />}
        {groups.map((group) => (
          <section className="trend" key={group.map((each) => each.id).join()}>
            <ul>
              {group.map((each, n) => (
                <li key={each.id}>
                  <span className="trend-line" data-line={n + 1} aria-hidden="true" />
                  <span>{each.name}</span>
                  <strong>{textAt(each, cursor)}</strong>
                </li>
              ))}
            </ul>
            <SignalChart
              traces={group}
              whole={whole}
              range={range}
              cursor={cursor}
              alarms={moments}
              label={group.map((each) => each.name).join(", ")}
            />
          </section>
        ))}
      </div>
      {groups.length === 0 && <p className="quiet">{t`No values are chosen.`}</p>}
    </>
  );
}

function Facts({ recording: { alarms, run, error, error_message, run_failed, complete } }: { recording: Recording }) {
  const why = error ? splitAddress(translate(error_message ?? { text: error })).text : "";
  return (
    <div className="recording-facts">
      {alarms.map((each) => (
        <p key={each.number}>
          <span className="tag bad">{seconds(each.time)}</span>{" "}
          {each.object_name && <strong>{each.object_name} </strong>}
          {splitAddress(translate(each.text_message ?? { text: each.text })).text}
        </p>
      ))}
      {run !== undefined && (
        <p className="quiet small">
          {run_failed ? t`Run ${run} has failed.` : t`During run ${run}.`} {run_failed && why}
        </p>
      )}
      {!complete && <p className="quiet small">{t`The seconds after the event are missing so far.`}</p>}
    </div>
  );
}

interface ChooserProps {
  signals: readonly Signal[];
  shown: ReadonlySet<string>;
  onChange: (shown: Set<string>) => void;
}

function Chooser({ signals, shown, onChange }: ChooserProps) {
  const [all, setAll] = useState(false);
  const changed = signals.filter((each) => changes(each) || shown.has(idOf(each)));
  const devices = new Map<string, Signal[]>();
  for (const each of all ? signals : changed)
    devices.set(each.object_name, [...(devices.get(each.object_name) ?? []), each]);
  const toggle = (id: string) => {
    const next = new Set(shown);
    if (!next.delete(id)) next.add(id);
    onChange(next);
  };
  return (
    <details className="recording-chooser">
      <summary>{plural(shown.size, { one: "# value shown", other: "# values shown" })}</summary>
      <div>
        {[...devices].map(([device, each]) => (
          <fieldset key={device}>
            <legend>{device}</legend>
            {each.map((signal) => (
              <label key={idOf(signal)}>
                <input type="checkbox" checked={shown.has(idOf(signal))} onChange={() => toggle(idOf(signal))} />
                <span>{nameOf(signal)}</span>
              </label>
            ))}
          </fieldset>
        ))}
      </div>
      {changed.length < signals.length && (
        <Button variant="plain" onPress={() => setAll(!all)}>
          {all ? t`Only values that changed` : t`Also values that did not change`}
        </Button>
      )}
    </details>
  );
}

function textAt(trace: Trace, time: number): string {
  const value = valueAt(trace, time);
  if (value === null) return t`unknown`;
  if (trace.digital) return value ? t`on` : t`off`;
  const text = decimal(value, Math.abs(value) < 10 ? 3 : 1);
  return trace.unit ? `${text}\u00a0${trace.unit}` : text;
}

/** Return a time relative to the event. */
const seconds = (time: number): string =>
  `${time > 0 ? "+" : time < 0 ? "−" : ""}${fixed(Math.abs(time) / 1000, 2)}\u00a0s`;

/** Return the unit of a joint. */
function unitOf({ kind, object_id, name }: Signal): string {
  if (kind !== "joint") return "";
  const limits = theEngine()?.limits(object_id) ?? [];
  return limits.some((each) => each.name === name && each.prismatic) ? "m" : "rad";
}
