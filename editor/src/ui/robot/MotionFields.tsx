/** Options of all motions: speed, straight line, collision check. */

import { t } from "@lingui/core/macro";
import { MoreOrLess, OnOff } from "../kit/fields";
import { setManner, useManner } from "./motionOptions";

export function MannerFields() {
  const { speed, safe, linear } = useManner();
  return (
    <div className="manner">
      <MoreOrLess
        label={t`Speed`}
        value={speed}
        least={0.01}
        most={1}
        step={0.01}
        words={(value) => `${Math.round(value * 100)} %`}
        onChange={(next) => setManner({ speed: next })}
      />
      <OnOff isSelected={safe} onChange={(next) => setManner({ safe: next })}>
        {t`Check for collisions`}
      </OnOff>
      <OnOff isSelected={linear} onChange={(next) => setManner({ linear: next })}>
        {t`Straight line`}
      </OnOff>
    </div>
  );
}
