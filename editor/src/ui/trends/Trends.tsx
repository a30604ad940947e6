/** Trends of the values of a device and of the joints of a robot, while the panel is open and the page is visible. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { sentence } from "../../commands/requests";
import { decimal } from "../../formats";
import { inUserLanguage } from "../../i18n/serverMessages";
import type { Observation } from "../../protocol/types";
import { call } from "../../session/connection";
import { theEngine } from "../../session/engine";
import { isLive } from "../../store/selectors";
import { getState, useEditor } from "../../store/store";
import { STALE, telemetry } from "../../store/telemetry";
import { RefusedText } from "../points/Refusal";
import { useVisible } from "../useVisible";
import { Chart, MOST } from "./Chart";
import { charts, type History, NO_HISTORY, RATE, type Series, shownValue, withObservations } from "./history";
import "./trends.css";

export default function Trends({ id }: { id: string }) {
  const type = useEditor((state) => state.doc?.objects[id]?.type ?? "");
  const robot = useEditor((state) => state.types.robots[type] !== undefined);
  const observable = useEditor((state) => state.types.byName[type]?.observable);
  return (
    <>
      {robot && <Joints id={id} />}
      {observable && <Observations id={id} />}
    </>
  );
}

/** The joints of a robot, which it reports anyway. */
function Joints({ id }: { id: string }) {
  const [history, setHistory] = useState<History>(NO_HISTORY);
  const live = useEditor((state) => isLive(state) && state.connection.status === "ready");
  const seen = useVisible();
  useEffect(() => {
    if (!live || !seen) return;
    const timer = setInterval(() => {
      const newest = telemetry.latest(id);
      if (!newest || performance.now() / 1000 - newest.at > STALE) return;
      const limits = theEngine()?.limits(id) ?? [];
      const observations = [...newest.joints].map(([name, value]): Observation => {
        const unit = limits.some((each) => each.name === name && each.prismatic) ? "m" : "rad";
        return { name, value, unit, quality: "good" };
      });
      setHistory((known) => withObservations(known, { observations }, Date.now() / 1000));
    }, 1000 / RATE);
    return () => clearInterval(timer);
  }, [id, live, seen]);
  if (history.times.length > 0) return <Charts history={history} />;
  return (
    <p className="quiet">
      {live ? t`The robot reports no joint positions.` : t`Go online to see values of the device.`}
    </p>
  );
}

function Charts({ history }: { history: History }) {
  return charts(history.series, MOST).map((group) => (
    <section className="trend" key={group.map((each) => each.id).join()}>
      <ul>
        {group.map((each, n) => (
          <li key={each.id}>
            <span className="trend-line" data-line={n + 1} aria-hidden="true" />
            <span>{each.name}</span>
            <strong data-quality={each.last.quality}>{textOf(each)}</strong>
          </li>
        ))}
      </ul>
      <Chart times={history.times} series={group} />
    </section>
  ));
}

function Observations({ id }: { id: string }) {
  const [history, setHistory] = useState<History>(NO_HISTORY);
  const [failed, setFailed] = useState("");
  const live = useEditor((state) => isLive(state) && state.connection.status === "ready");
  const seen = useVisible();
  useEffect(() => {
    if (!live || !seen) return;
    const { runtime } = getState();
    runtime.takeObservations = (data) => {
      if (data.object_id !== id) return;
      setFailed("");
      setHistory((known) => withObservations(known, inUserLanguage(data), Date.now() / 1000));
    };
    call("StreamObservations", { object_id: id, rate: RATE }).catch((error: unknown) => setFailed(sentence(error)));
    return () => {
      runtime.takeObservations = undefined;
      // The request is refused if the scene has gone offline, which also ends the stream.
      call("StreamObservations", { object_id: id, send: false }).catch(() => {});
    };
  }, [id, live, seen]);
  if (!live && history.times.length === 0) return <p className="quiet">{t`Go online to see values of the device.`}</p>;
  return (
    <>
      <Charts history={history} />
      {live && !failed && history.times.length === 0 && <p className="quiet">{t`Waiting for values…`}</p>}
      {history.times.length > 0 && history.series.length === 0 && !history.failure && (
        <p className="quiet">{t`The device has no values now.`}</p>
      )}
      <RefusedText>{failed || history.failure}</RefusedText>
    </>
  );
}

function textOf({ binary, unit, last }: Series): string {
  const value = shownValue(last);
  if (value === null) return t`unknown`;
  if (binary) return value ? t`on` : t`off`;
  const text = decimal(value, Math.abs(value) < 10 ? 3 : 1);
  return unit ? `${text}\u00a0${unit}` : text;
}
