/** Display of all items for this user: transparency, fading, lines to parents. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { storeGeneralState, storeViewState } from "../../commands/viewstate";
import { useEditor } from "../../store/store";
import { parentLines } from "../../viewmodel/items";
import { fadesOthers, opacityOfAll } from "../../viewmodel/visibility";
import { SliderField, SwitchField } from "../kit/fields";

/** Parts of the view that users can hide, with the keys under which the server stores that. */
const HIDEABLE = [
  ["hide_orientations", msg`Orientation arrows`],
  ["hide_axes", msg`End effector axes`],
  ["hide_steps", msg`Program steps`],
] as const;

export function ViewSettings({ narrowed }: { narrowed: boolean }) {
  const opacity = useEditor(opacityOfAll);
  const fades = useEditor(fadesOthers);
  const lines = useEditor(parentLines);
  const view = useEditor((state) => state.view.user);
  const [moved, setMoved] = useState<number | null>(null);
  return (
    <section className="section" aria-label={t`In the view`}>
      <h3>{t`In the view`}</h3>
      <SwitchField isSelected={fades} onChange={(on) => storeViewState("user", { fade_others: on || null })}>
        {t`Fade other kinds`}
      </SwitchField>
      {fades && !narrowed && <p className="quiet small">{t`Choose kinds above first.`}</p>}
      <SliderField
        label={t`Transparency of objects`}
        value={1 - (moved ?? opacity)}
        least={0}
        most={0.95}
        step={0.05}
        words={(value) => `${Math.round(value * 100)} %`}
        onChange={(value) => setMoved(1 - value)}
        onEnd={(value) => {
          storeViewState("user", { opacity_all: value > 0 ? 1 - value : null });
          setMoved(null);
        }}
      />
      {HIDEABLE.map(([key, words]) => (
        <SwitchField
          key={key}
          isSelected={view[key] !== true}
          onChange={(on) => storeViewState("user", { [key]: on ? null : true })}
        >
          {i18n._(words)}
        </SwitchField>
      ))}
      <SwitchField isSelected={lines} onChange={(on) => storeGeneralState({ parent_lines: on || null })}>
        {t`Lines from points to their parents`}
      </SwitchField>
    </section>
  );
}
