/** Check the connection to a device with the settings as typed, before they are saved. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { checkConnection } from "../../commands/scene";
import { decimal } from "../../formats";
import { translatedAlarm } from "../../i18n/serverMessages";
import { missing, parametersOf, type Values } from "../../program/settings";
import type { CheckConnectionData, ObjectTypeMeta } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText } from "../points/Refusal";

interface CheckProps {
  type: ObjectTypeMeta;
  values: Values;
  /** Id of the object if it exists. */
  id?: string;
  /** Node of an object that is not in the scene. */
  node?: string;
}

export function Check({ type, values, id = "", node = "" }: CheckProps) {
  const cannot = useEditor((state) => whyUnavailable(state, "CheckConnection"));
  const connected = useEditor((state) => id !== "" && state.live.state !== "stopped");
  const [busy, setBusy] = useState(false);
  const [result, setResult] = useState<{ of: string; found?: CheckConnectionData; refused?: string } | null>(null);
  const of = JSON.stringify([values, node]);
  const why = cannot || (missing(type.settings, values).length > 0 ? t`Fill in the required settings first.` : "");
  const check = async () => {
    setBusy(true);
    setResult({ of, ...(await checkConnection(type.type, parametersOf(type.settings, values), id, node)) });
    setBusy(false);
  };
  // A result is only shown for the settings that were checked.
  const shown = result?.of === of ? result : null;
  if (connected) return null;
  return (
    <div className="connection-check">
      <Button icon="plug" className="wraps" why={why} isDisabled={busy} onPress={() => void check()}>
        {busy ? t`Connecting…` : t`Test connection`}
      </Button>
      <div role="status">
        {shown?.found && <Found found={shown.found} />}
        {shown?.refused && <RefusedText>{shown.refused}</RefusedText>}
      </div>
    </div>
  );
}

function Found({ found: { identity, health, alarms, seconds } }: { found: CheckConnectionData }) {
  const { vendor, model, serial, firmware } = identity;
  const about = [[vendor, model].filter(Boolean).join(" "), serial && t`serial number ${serial}`, firmware]
    .filter(Boolean)
    .join(", ");
  return (
    <>
      <p className="small">
        <span className={`tag ${health === "normal" ? "good" : "warn"}`}>{t`Connected`}</span>{" "}
        {[about, t`${decimal(seconds, 1)} s`].filter(Boolean).join(" · ")}
      </p>
      {alarms.map(translatedAlarm).map((alarm) => (
        <p key={alarm.code} className="small alarm">
          {alarm.text}
        </p>
      ))}
    </>
  );
}
