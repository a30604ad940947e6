/** Search for devices when the user asks for it, and offer those found as values of a setting. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { findDevices } from "../../commands/scene";
import { parametersOf, type Values } from "../../program/settings";
import type { FoundDevice, ObjectTypeMeta, ParameterMeta } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { RefusedText } from "../points/Refusal";

interface FindDevicesProps {
  type: ObjectTypeMeta;
  setting: ParameterMeta;
  values: Values;
  onFound: (value: string) => void;
}

export function FindDevices({ type, setting: { name, found_by }, values, onFound }: FindDevicesProps) {
  const cannot = useEditor((state) => whyUnavailable(state, "FindDevices"));
  const [busy, setBusy] = useState(false);
  const [result, setResult] = useState<{ found?: FoundDevice[]; refused?: string }>({});
  const search = async () => {
    setBusy(true);
    setResult({});
    setResult(await findDevices(type.type, name, parametersOf(type.settings, values)));
    setBusy(false);
  };
  const use = (value: string) => {
    setResult({});
    onFound(value);
  };
  return (
    <div className="found-devices">
      <Button icon="search" className="wraps" why={cannot} isDisabled={busy} onPress={() => void search()}>
        {busy ? t`Searching…` : searchWords(found_by)}
      </Button>
      <div role="status">
        {result.found && <Found found={result.found} value={values[name]} onFound={use} />}
        {result.refused && <RefusedText>{result.refused}</RefusedText>}
      </div>
    </div>
  );
}

function searchWords(search = ""): string {
  if (search === "serial") return t`Find serial ports`;
  return search === "can" ? t`Find nodes on the bus` : t`Find cameras`;
}

interface FoundProps {
  found: FoundDevice[];
  /** The present value of the setting. */
  value: string | undefined;
  onFound: (value: string) => void;
}

export function Found({ found, value, onFound }: FoundProps) {
  if (found.length === 0) return <p className="small">{t`Nothing found. Check the cable and the power.`}</p>;
  return (
    <ul className="kinds" aria-label={t`Found devices`}>
      {found.map(({ value: offered, address, description, serial }) => (
        <li key={offered}>
          <button type="button" className="kind" aria-pressed={offered === value} onClick={() => onFound(offered)}>
            <Icon name="plug" />
            <span>
              <strong>{description || address}</strong>
              <span className="small quiet">
                {[address, serial && t`serial number ${serial}`].filter(Boolean).join(" · ")}
              </span>
            </span>
          </button>
        </li>
      ))}
    </ul>
  );
}
