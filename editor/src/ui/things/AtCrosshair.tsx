/** List of the items at the crosshair, most likely first. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { ListBox, ListBoxItem } from "react-aria-components";
import { storeGeneralState } from "../../commands/viewstate";
import { aimsAlways, chooseCandidate, listAimed } from "../../session/aiming";
import type { State } from "../../store/state";
import { getState, useEditor } from "../../store/store";
import { kindName, nameOf, selectionOf } from "../../viewmodel/names";
import { SwitchField } from "../kit/fields";
import { Icon } from "../kit/icons";
import { pick } from "../workplace/pick";
import { ICONS } from "./ThingTree";

export function AtCrosshair() {
  const { candidates, chosen } = useEditor((state) => state.ui.crosshair);
  const always = useEditor(aimsAlways);
  useEffect(listAimed, []);
  return (
    <>
      <ListBox
        aria-label={t`At the crosshair`}
        className="things"
        items={candidates.map((id) => ({ id }))}
        dependencies={[chosen]}
        onAction={(key) => pick([String(key)])}
        renderEmptyState={() => <p className="quiet">{t`Nothing at the crosshair. Turn the view.`}</p>}
      >
        {({ id }) => {
          const state = getState();
          const kind = selectionOf(state, id)?.kind ?? "object";
          return (
            <ListBoxItem
              id={id}
              textValue={nameOf(state, id)}
              className="thing"
              data-chosen={id === chosen}
              onHoverStart={() => chooseCandidate(id)}
            >
              <Icon name={ICONS[kind]} />
              <span className="thing-name">{nameOf(state, id)}</span>
              <span className="quiet small">
                {kindName(kind)}
                {parentOf(state, id) && ` ${t`on ${parentOf(state, id)}`}`}
              </span>
            </ListBoxItem>
          );
        }}
      </ListBox>
      <SwitchField isSelected={always} onChange={(on) => storeGeneralState({ aiming: on || null })}>
        {t`Keep the crosshair when this is closed`}
      </SwitchField>
    </>
  );
}

/** Return the name of an item's parent. */
function parentOf(state: State, id: string): string {
  const { doc } = state;
  const on = doc?.points[id]?.parent ?? doc?.actions[id]?.pointId ?? doc?.orientations[id]?.pointId;
  return on ? nameOf(state, on) : "";
}
