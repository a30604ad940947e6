/** The cell as a machine: PackML state, mode, who commands it, and whether the PLC is alive; a separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useState } from "react";
import * as requests from "../../commands/requests";
import type { CellAuthority } from "../../protocol/types";
import { call } from "../../session/connection";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Button, Waiting } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";
import { AUTHORITIES, MODES, plcText, programText, STATES } from "./texts";
import { useCell } from "./useCell";
import "./cell.css";

export default function CellDialog({ onClose }: { onClose: () => void }) {
  const cell = useCell();
  const connected = useEditor((state) => state.connection.status === "ready");
  const noMode = useEditor((state) => whyUnavailable(state, "SetCellMode"));
  const noAuthority = useEditor((state) => whyUnavailable(state, "SetCellAuthority"));
  const mode = useRefusal();
  const authority = useRefusal();
  const [confirming, setConfirming] = useState(false);
  const command = (by: CellAuthority) =>
    void authority.ask(requests.refusal(() => call("SetCellAuthority", { authority: by })));
  const plc = cell && plcText(cell);
  const program = cell && programText(cell);
  return (
    <ModalDialog title={t`Mode and authority`} onClose={onClose}>
      {!connected && <p>{t`Not connected to the server.`}</p>}
      {connected && !cell && <Waiting>{t`Loading…`}</Waiting>}
      {connected && cell && plc && (
        <div className="cell-page">
          <dl>
            <div>
              <dt>{t`State`}</dt>
              <dd>
                <strong>{i18n._(STATES[cell.state])}</strong>
                {program && <span className="small">{program}</span>}
              </dd>
            </div>
            <div>
              <dt>{t`PLC`}</dt>
              <dd>
                {plc.word && <span className={`tag ${plc.tone}`}>{plc.word}</span>}
                <span className="small">{plc.text}</span>
              </dd>
            </div>
          </dl>
          <Choice
            label={t({ message: "Mode", context: "PackML" })}
            options={MODES}
            chosen={cell.mode}
            why={noMode}
            refusal={mode}
            onChoose={(to) => void mode.ask(requests.refusal(() => call("SetCellMode", { mode: to })))}
          />
          <Choice
            label={t`Who commands this cell`}
            wide
            options={AUTHORITIES}
            chosen={cell.authority}
            why={noAuthority}
            refusal={authority}
            onChoose={(by) => (by === "plc" ? setConfirming(true) : command(by))}
          />
          <p className="quiet small">
            {t`Anybody can stop the cell at any time. Mode and authority are not a safety function.`}
          </p>
        </div>
      )}
      <div className="actions">
        <Button onPress={onClose}>{t`Close`}</Button>
      </div>
      {confirming && (
        <Confirm
          title={t`Let the PLC command this cell?`}
          confirmLabel={t`Let the PLC command`}
          onClose={() => setConfirming(false)}
          onConfirm={() => command("plc")}
        >
          <p>{t`The PLC then starts programs at any time, without a person at a screen.`}</p>
        </Confirm>
      )}
    </ModalDialog>
  );
}

interface ChoiceProps<Id> {
  label: string;
  options: readonly { id: Id; name: MessageDescriptor; detail: MessageDescriptor }[];
  chosen: Id;
  /** One below the other. */
  wide?: boolean;
  why: string;
  refusal: { refused: string; busy: boolean };
  onChoose: (id: Id) => void;
}

/** Large buttons, of which the chosen one is marked. If the user may not choose, the reason is shown, too. */
function Choice<Id extends string>({ label, options, chosen, wide = false, why, refusal, onChoose }: ChoiceProps<Id>) {
  return (
    <section className="cell-choice" data-wide={wide} role="group" aria-label={label}>
      <h3>{label}</h3>
      {why && <p className="quiet small">{why}</p>}
      <RefusedText>{refusal.refused}</RefusedText>
      {options.map(({ id, name, detail }) => (
        <Button
          key={id}
          className="wraps"
          icon={id === chosen ? "check" : undefined}
          aria-pressed={id === chosen}
          why={why}
          isDisabled={refusal.busy}
          onPress={() => id !== chosen && onChoose(id)}
        >
          <span>
            <strong>{i18n._(name)}</strong>
            <span className="small">{i18n._(detail)}</span>
          </span>
        </Button>
      ))}
    </section>
  );
}
