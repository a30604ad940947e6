/** Switch between the views of the centre. It is loaded on demand because of the size of its keyboard navigation. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { ToggleButton, ToggleButtonGroup } from "react-aria-components";
import { setUi } from "../../store/store";
import type { Mode } from "../../store/ui";

const WORDS: Record<Mode, MessageDescriptor> = { "3d": msg`3D`, flow: msg`Flow`, split: msg`Split`, code: msg`Code` };

export default function ModeSwitch({ mode, modes }: { mode: Mode; modes: readonly Mode[] }) {
  return (
    <ToggleButtonGroup
      className="modes"
      aria-label={t`View mode`}
      selectionMode="single"
      disallowEmptySelection
      selectedKeys={[mode]}
      onSelectionChange={(keys) => setUi({ mode: [...keys][0] as Mode })}
    >
      {modes.map((each) => (
        <ToggleButton key={each} id={each} className="button mode">
          {i18n._(WORDS[each])}
        </ToggleButton>
      ))}
    </ToggleButtonGroup>
  );
}
