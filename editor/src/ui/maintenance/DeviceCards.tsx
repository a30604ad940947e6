/** Device cards: identity, hours, parameters and calibrations of each device. A separate chunk. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { differenceOf } from "../../commands/maintenance";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Button, Waiting } from "../kit/kit";
import { stateName, TONE } from "../workplace/sections/about";
import { Card } from "./Card";
import { SwapWizard } from "./SwapWizard";
import { useDeviceCards } from "./useDeviceCards";
import "./maintenance.css";

export default function DeviceCards({ first = "", onClose }: { first?: string; onClose: () => void }) {
  const { cards, reload } = useDeviceCards();
  const states = useEditor((state) => state.live.objects);
  const [opened, setOpened] = useState(first);
  const [replacing, setReplacing] = useState(false);
  const card = cards?.find((each) => each.object_id === opened);
  if (card && replacing)
    return (
      <ModalDialog title={t`Replace ${card.name}`} onClose={() => setReplacing(false)}>
        <SwapWizard card={card} reload={reload} onClose={() => setReplacing(false)} onLeave={onClose} />
      </ModalDialog>
    );
  if (card)
    return (
      <ModalDialog title={card.name} onClose={onClose}>
        <Card card={card} reload={reload} onReplace={() => setReplacing(true)} />
        <div className="actions">
          <Button onPress={() => setOpened("")}>{t`All devices`}</Button>
          <Button variant="primary" onPress={onClose}>
            {t`Close`}
          </Button>
        </div>
      </ModalDialog>
    );
  return (
    <ModalDialog title={t`Device cards`} onClose={onClose}>
      {cards === null && <Waiting>{t`Loading…`}</Waiting>}
      {(cards?.length === 0 || (cards && opened)) && (
        <p className="quiet">{t`A device has a card once it was online and reported its identity.`}</p>
      )}
      <ul className="device-cards">
        {cards?.map((each) => {
          const state = states[each.object_id]?.state ?? "offline";
          return (
            <li key={each.object_id}>
              <Button onPress={() => setOpened(each.object_id)}>
                <strong data-name={each.name}>{each.name}</strong>
                <span className="quiet small">
                  {each.identity.model} {each.identity.serial}
                </span>
                {each.found ? (
                  <span className="tag bad">{t`different device`}</span>
                ) : (
                  <span className={`tag ${TONE[state] ?? ""}`}>{stateName(state)}</span>
                )}
                {each.found && <span className="small">{differenceOf(each)}</span>}
              </Button>
            </li>
          );
        })}
      </ul>
      <div className="actions">
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}
