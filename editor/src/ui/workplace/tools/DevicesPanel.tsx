/** Connection and health of each device; a failed one can be retried. */

import { t } from "@lingui/core/macro";
import { lazy, Suspense, useState } from "react";
import { retryObject } from "../../../commands/operation";
import { byName } from "../../../formats";
import { translatedAlarm } from "../../../i18n/serverMessages";
import { words } from "../../../program/naming";
import { serves } from "../../../session/connection";
import { whyUnavailable } from "../../../store/permissions";
import { derivesFrom } from "../../../store/selectors";
import { useEditor } from "../../../store/store";
import { openPoints } from "../../io/address";
import { Button } from "../../kit/kit";
import { openOverlay } from "../../search/overlay";
import { stateName, TONE } from "../sections/about";
import { uncontrolledOnline } from "../uncontrolled";
import "../../alarms/alarms.css";

const DeviceCards = lazy(() => import("../../maintenance/DeviceCards"));
const NodeList = lazy(() => import("../../nodes/NodeList"));
const AlarmList = lazy(() => import("../../alarms/AlarmList"));

export default function Panel() {
  const live = useEditor((state) => state.live);
  const doc = useEditor((state) => state.doc);
  const cannot = useEditor((state) => whyUnavailable(state, "RetryObject"));
  const isFaulty = (id: string) => live.objects[id]?.state === "failed" || live.objects[id]?.state === "lost";
  // Boxes and tables are not devices.
  const inert = useEditor((state) =>
    Object.values(state.doc?.objects ?? {})
      .filter((each) => derivesFrom(state, each.type, "VirtualCollisionObject"))
      .map((each) => each.id)
      .join(),
  );
  const devices = Object.values(doc?.objects ?? {}).filter(
    (each) => isFaulty(each.id) || !inert.split(",").includes(each.id),
  );
  const limited = useEditor(uncontrolledOnline);
  const hasNodes = useEditor((state) => state.nodes?.configured === true);
  const [card, setCard] = useState<string | null>(null);
  // Faulty devices first.
  const objects = devices.sort((a, b) => Number(isFaulty(b.id)) - Number(isFaulty(a.id)) || byName(a, b));
  return (
    <>
      {live.state === "stopped" && (
        <p className="quiet">
          {t`The workplace is offline.`} {live.message}
        </p>
      )}
      <ul className="devices" tabIndex={0} aria-label={t`Devices`}>
        {objects.map((object) => {
          const state = live.objects[object.id];
          const health = live.health[object.id];
          const lacking = limited.find((each) => each.id === object.id);
          const failed = state?.state === "failed" || state?.state === "lost";
          return (
            <li key={object.id}>
              <div className="device-head">
                <strong>{object.name}</strong>
                {state?.answering === false ? (
                  <span className="tag bad">{t`not answering`}</span>
                ) : (
                  <span className={`tag ${lacking && !failed ? "warn" : (TONE[state?.state ?? ""] ?? "")}`}>
                    {stateName(state?.state ?? "offline")}
                  </span>
                )}
              </div>
              {state?.reason && <p className="small">{state.reason}</p>}
              {lacking && (
                <p className="small">
                  {t`Cannot be controlled: ${lacking.settings.map(words).join(", ")} is not set.`}
                </p>
              )}
              {health?.alarms.map(translatedAlarm).map((alarm) => (
                <p key={alarm.code} className="small alarm">
                  {alarm.text}
                  {alarm.remedy && <span className="quiet"> {alarm.remedy}</span>}
                </p>
              ))}
              {health?.alarms.some((each) => each.code === "different_device") && (
                <Button onPress={() => setCard(object.id)}>{t`Open the device card`}</Button>
              )}
              {failed && live.state === "started" && serves("RetryObject") && (
                <Button
                  isDisabled={cannot !== ""}
                  onPress={() => void retryObject(object.id)}
                  aria-label={t`Retry ${object.name}`}
                >
                  {t`Retry`}
                </Button>
              )}
            </li>
          );
        })}
      </ul>
      {hasNodes && (
        <Suspense fallback={null}>
          <NodeList />
        </Suspense>
      )}
      {doc && serves("StreamPoints") && <Button onPress={openPoints}>{t`Inputs and outputs`}</Button>}
      {serves("ListDeviceCards") && <Button onPress={() => setCard("")}>{t`Device cards`}</Button>}
      {card !== null && (
        <Suspense fallback={null}>
          <DeviceCards first={card} onClose={() => setCard(null)} />
        </Suspense>
      )}
      {doc && serves("ListInterlocks") && (
        <Button onPress={() => openOverlay("interlocks")}>{t`Interlocks and zones`}</Button>
      )}
      {serves("GetCell") && <Button onPress={() => openOverlay("cell")}>{t`Mode and authority`}</Button>}
      {serves("ListAlarms") && <Alarms />}
    </>
  );
}

/** All alarms, loaded when they are opened. */
function Alarms() {
  const [open, setOpen] = useState(false);
  return (
    <details className="all-alarms" aria-label={t`All alarms`} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>{t`All alarms`}</summary>
      {open && (
        <Suspense>
          <AlarmList />
        </Suspense>
      )}
    </details>
  );
}
