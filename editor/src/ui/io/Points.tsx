/** The page of inputs and outputs, at `/#/io`: the live points of all devices, and forcing. A separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { memo, Suspense, useEffect, useState } from "react";
import { Input, Label, SearchField } from "react-aria-components";
import { isRecording } from "../../commands/history";
import type { ForcedPoint, LivePoint, PointQuality, PointUse } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { derivesFrom, isLive, isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import { getState, useEditor } from "../../store/store";
import { useCellName } from "../cell/CellName";
import { SelectField } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { Notices } from "../notices/Notices";
import { People } from "../people/People";
import { closePoints } from "./address";
import { EndForce } from "./EndForce";
import { ForceForm } from "./ForceForm";
import { type ShownDevice, type ShownPoint, shownDevices } from "./points";
import { usePoints } from "./usePoints";
import "./io.css";

const PointHistory = lazyComponent(() => import("./PointHistory"));

const USES: Record<PointUse, MessageDescriptor> = {
  input: msg`input`,
  output: msg`output`,
  register: msg`register`,
  signal: msg`signal`,
};
const QUALITIES: Record<PointQuality, MessageDescriptor> = {
  good: msg`good`,
  uncertain: msg`uncertain`,
  stale: msg`stale`,
  bad: msg`bad`,
  not_connected: msg`not connected`,
};

/** An output that is about to be forced. */
interface Forcing {
  objectId: string;
  device: string;
  point: LivePoint;
}

/** A point whose history is shown. */
interface HistoryTarget {
  objectId: string;
  device: string;
  id: string;
  name: string;
  unit: string;
}

/** Return why no output can be forced now; an empty string if one can. */
function notForcible(state: State): string {
  if (isRunning(state)) return t`A program is running. Stop it first.`;
  return whyUnavailable(state, "ForcePoint");
}

export default function Points() {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const live = useEditor(isLive);
  const connected = useEditor((state) => state.connection.status === "ready");
  const forces = useEditor((state) => state.forces);
  const why = useEditor(notForcible);
  const objects = Object.values(doc?.objects ?? {}).filter(
    (each) => !derivesFrom(getState(), each.type, "VirtualCollisionObject"),
  );
  const cell = useCellName();
  const [device, setDevice] = useState("");
  const [text, setText] = useState("");
  const [forcing, setForcing] = useState<Forcing | null>(null);
  const [historyOf, setHistoryOf] = useState<HistoryTarget | null>(null);
  const [recorded, setRecorded] = useState(false);
  useEffect(() => {
    if (connected) isRecording().then(setRecorded, () => setRecorded(false));
  }, [connected]);
  const reported = usePoints(objects);
  const filter = { device, text };
  const present = { time: performance.now() / 1000, connected };
  const observations = (type: string) => types.byName[type]?.observations ?? [];
  const all = shownDevices(objects, reported, { device: "", text: "" }, present, observations);
  const found = shownDevices(objects, reported, filter, present, observations);
  return (
    <div className="io-page">
      <header className="bar">
        <Button variant="plain" icon="left" aria-label={t`Back`} onPress={closePoints} />
        {cell && <strong className="cell-name">{cell}</strong>}
        <h1>{t`Inputs and outputs`}</h1>
        <People />
      </header>
      <main tabIndex={0} aria-label={t`Inputs and outputs`}>
        {live && (
          <div className="io-filter">
            <SearchField className="field search" value={text} onChange={setText}>
              <Label className="hidden-but-read">{t`Search`}</Label>
              <Input placeholder={t`Search device or point`} />
            </SearchField>
            <SelectField
              label={t`Device`}
              value={device}
              choices={[["", t`All devices`], ...all.map((each) => [each.id, each.name] as const)]}
              onChange={setDevice}
            />
          </div>
        )}
        {!live && <p className="quiet">{t`Go online to see the inputs and outputs of the devices.`}</p>}
        {live && all.length > 0 && (
          <p className="quiet small">{t`Values without a remark are good and less than one second old.`}</p>
        )}
        {live && all.length === 0 && <Waiting>{t`Waiting for values…`}</Waiting>}
        {live && all.length > 0 && found.length === 0 && <p className="quiet">{t`No point matches.`}</p>}
        {live &&
          found.map((each) => (
            <Device
              key={each.id}
              device={each}
              forces={forces}
              why={why}
              onForce={setForcing}
              onHistory={recorded ? setHistoryOf : undefined}
            />
          ))}
      </main>
      {forcing && <ForceForm {...forcing} onClose={() => setForcing(null)} />}
      {historyOf && (
        <Suspense fallback={null}>
          <PointHistory {...historyOf} onClose={() => setHistoryOf(null)} />
        </Suspense>
      )}
      <Notices />
    </div>
  );
}

interface DeviceProps {
  device: ShownDevice;
  forces: readonly ForcedPoint[];
  why: string;
  onForce: (forcing: Forcing) => void;
  /** Undefined if the server records no history. */
  onHistory: ((past: HistoryTarget) => void) | undefined;
}

function Device({ device, forces, why, onForce, onHistory }: DeviceProps) {
  const forcedBy = new Map(forces.filter((each) => each.object_id === device.id).map((each) => [each.point, each]));
  return (
    <section className="io-device" aria-label={device.name}>
      <h2 data-name={device.name}>{device.name}</h2>
      {device.reason && <p className="small error">{device.reason}</p>}
      <ul>
        {device.points.map((each) => (
          <Row
            key={each.id}
            device={device.name}
            {...each}
            force={forcedBy.get(each.id)}
            why={why}
            onForce={() => onForce({ objectId: device.id, device: device.name, point: each.point })}
            onHistory={
              onHistory &&
              typeof each.point.value !== "string" &&
              (() =>
                onHistory({ objectId: device.id, device: device.name, id: each.id, name: each.name, unit: each.unit }))
            }
          />
        ))}
      </ul>
    </section>
  );
}

interface RowProps extends ShownPoint {
  device: string;
  force: ForcedPoint | undefined;
  why: string;
  onForce: () => void;
  onHistory: (() => void) | false | undefined;
}

/** A point. It is drawn again only if what it shows has changed. */
const Row = memo(
  function Row({ device, name, use, text, on, quality, age, point, force, why, onForce, onHistory }: RowProps) {
    const output = `${device}: ${name}`;
    const lasting = t`The device would keep a forced value if the computer failed. So this output cannot be forced.`;
    return (
      <li data-quality={quality} data-on={on ?? undefined} data-forced={force !== undefined}>
        <span className="io-name">
          <strong data-name={name}>{name}</strong>
          <span className="quiet small">{i18n._(USES[use])}</span>
        </span>
        <span className="io-value">
          <strong data-name={text}>{text}</strong>
          {(quality !== "good" || age) && (
            <span className="small">
              {[quality !== "good" && i18n._(QUALITIES[quality]), age].filter(Boolean).join(", ")}
            </span>
          )}
          {force && <span className="tag warn">{t`forced by ${force.user}`}</span>}
        </span>
        {onHistory && (
          <Button variant="plain" aria-label={t`History of ${output}`} onPress={onHistory}>
            {t`History`}
          </Button>
        )}
        {force ? (
          <EndForce force={force} />
        ) : (
          use === "output" && (
            <Button why={why || (point.force ? "" : lasting)} aria-label={t`Force ${output}`} onPress={onForce}>
              {t`Force`}
            </Button>
          )
        )}
      </li>
    );
  },
  (before, after) =>
    before.name === after.name &&
    before.text === after.text &&
    before.quality === after.quality &&
    before.age === after.age &&
    before.force === after.force &&
    before.why === after.why &&
    Boolean(before.onHistory) === Boolean(after.onHistory) &&
    before.point.force === after.point.force,
);
