/** Search for devices on request, and offer the found devices as values of a setting. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { findDevices } from "../../commands/scene";
import { parametersOf, type Values } from "../../program/settings";
import type { FoundDevice, ObjectTypeMeta, ParameterMeta } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
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
  // A network is searched only on request, and only at addresses that the user enters.
  const [open, setOpen] = useState(false);
  const [addresses, setAddresses] = useState("");
  const inNetwork = found_by === "ur" || found_by === "modbus";
  const search = async () => {
    setBusy(true);
    setResult({});
    setResult(await findDevices(type.type, name, parametersOf(type.settings, values), addresses));
    setBusy(false);
  };
  const use = (value: string) => {
    setResult({});
    onFound(value);
  };
  if (inNetwork && !open)
    return (
      <div className="found-devices">
        <Button icon="search" className="wraps" why={cannot} onPress={() => setOpen(true)}>
          {t`Search network…`}
        </Button>
      </div>
    );
  const missing = inNetwork && !addresses.trim() ? t`Enter the addresses to search.` : "";
  return (
    <div className="found-devices">
      {inNetwork && (
        <Field
          label={t`Addresses to search`}
          hint={t`For example 192.168.1.20 or 192.168.1.0/28, at most 256 addresses.`}
          value={addresses}
          onChange={setAddresses}
          autoFocus
          autoComplete="off"
        />
      )}
      <Button icon="search" className="wraps" why={cannot || missing} isDisabled={busy} onPress={() => void search()}>
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
  if (search === "can") return t`Find nodes on the bus`;
  return search === "oak" ? t`Find cameras` : t`Search`;
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
              <strong data-name>{description || address}</strong>
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
