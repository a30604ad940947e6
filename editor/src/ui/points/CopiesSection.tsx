/** Copy a point with its children: once, in a row, or mirrored. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { copyPoint, mirrorPoint } from "../../commands/points";
import type { Position } from "../../protocol/types";
import { NumberField } from "../kit/fields";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { useWhyNot } from "./editing";
import { RefusedText, useRefusal } from "./Refusal";

const CopiesSection: Section["Body"] = ({ selection: { id } }) => {
  const [count, setCount] = useState(1);
  const [step, setStep] = useState<Position>({ x: 0.05, y: 0, z: 0 });
  const why = useWhyNot(id, "CopyActionPoint");
  const { refused, busy, ask } = useRefusal();
  return (
    <details className="by-numbers">
      <summary>{t`Copies in a row`}</summary>
      <div className="amounts">
        {(["x", "y", "z"] as const).map((axis) => (
          <NumberField
            key={axis}
            label={t`Step ${axis.toUpperCase()}`}
            unit="mm"
            value={step[axis] * 1000}
            step={10}
            onChange={(next) => setStep({ ...step, [axis]: next / 1000 })}
          />
        ))}
        <NumberField
          label={t`Copies`}
          unit=""
          digits={0}
          value={count}
          least={1}
          most={50}
          onChange={(next) => setCount(Math.round(next))}
        />
      </div>
      <Button why={why} isDisabled={busy} onPress={() => void ask(copyPoint(id, count, step))}>
        {count === 1 ? t`Make a copy` : t`Make ${count} copies`}
      </Button>
      <div className="row" role="group" aria-label={t`Mirrored copy`}>
        <span className="quiet small">{t`Mirrored copy, in the frame of the parent:`}</span>
        {(["x", "y", "z"] as const).map((axis) => (
          <Button key={axis} why={why} isDisabled={busy} onPress={() => void ask(mirrorPoint(id, axis))}>
            {t`Mirror ${axis.toUpperCase()}`}
          </Button>
        ))}
      </div>
      <RefusedText>{refused}</RefusedText>
    </details>
  );
};

export default CopiesSection;
