/** Options of all motions: speed, straight line, collision check. */

import { t } from "@lingui/core/macro";
import { SliderField, SwitchField } from "../kit/fields";
import { setMotionOptions, useMotionOptions } from "./motionOptions";

export function MotionFields() {
  const { speed, safe, linear } = useMotionOptions();
  return (
    <div className="manner">
      <SliderField
        label={t`Speed`}
        value={speed}
        least={0.01}
        most={1}
        step={0.01}
        words={(value) => `${Math.round(value * 100)} %`}
        onChange={(next) => setMotionOptions({ speed: next })}
      />
      <SwitchField isSelected={safe} onChange={(next) => setMotionOptions({ safe: next })}>
        {t`Check for collisions`}
      </SwitchField>
      <SwitchField isSelected={linear} onChange={(next) => setMotionOptions({ linear: next })}>
        {t`Straight line`}
      </SwitchField>
    </div>
  );
}
