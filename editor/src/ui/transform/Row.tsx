/**
 * One coordinate with buttons for a step down and up. The value is a wheel: drag or scroll to change it by steps, tap
 * to type.
 */

import { t } from "@lingui/core/macro";
import { type KeyboardEvent, type PointerEvent, useEffect, useRef } from "react";
import { amountText, isAngle, stepWords, type Unit } from "../../transform/amounts";
import { Button } from "../kit/kit";

interface RowProps {
  label: string;
  value: number;
  unit: Unit;
  step: number;
  why: string;
  open: boolean;
  onSteps: (steps: number) => void;
  onOpen: () => void;
}

/** Distance of the wheel per step, px. */
const NOTCH = 14;

export function Row({ label, value, unit, step, why, open, onSteps, onOpen }: RowProps) {
  const wheel = useRef<HTMLButtonElement>(null);
  const drag = useRef<{ x: number; done: number } | null>(null);
  const rolled = useRef(false);
  const turn = useRef(onSteps);
  turn.current = onSteps;
  const words = stepWords(step, isAngle(unit) ? "angle" : "length");
  const amount = amountText(value, unit);

  // React's wheel listeners are passive, so the panel would scroll too.
  useEffect(() => {
    const element = wheel.current;
    if (!element || why) return;
    const roll = (event: WheelEvent) => {
      event.preventDefault();
      if (event.deltaY) turn.current(event.deltaY < 0 ? 1 : -1);
    };
    element.addEventListener("wheel", roll, { passive: false });
    return () => element.removeEventListener("wheel", roll);
  }, [why]);

  const move = (event: PointerEvent) => {
    if (!drag.current) return;
    const steps = Math.trunc((event.clientX - drag.current.x) / NOTCH);
    if (steps === drag.current.done) return;
    rolled.current = true;
    onSteps(steps - drag.current.done);
    drag.current.done = steps;
  };
  const key = (event: KeyboardEvent) => {
    const steps = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!steps || why) return;
    event.preventDefault();
    onSteps(steps);
  };
  return (
    <div className="axis-row" role="group" aria-label={label}>
      <span className="axis-name" data-axis={label} aria-hidden="true">
        {label}
      </span>
      <Button className="axis-step" aria-label={t`Decrease ${label} by ${words}`} why={why} onPress={() => onSteps(-1)}>
        −
      </Button>
      <button
        ref={wheel}
        type="button"
        className="axis-wheel"
        aria-expanded={open}
        aria-disabled={why !== "" || undefined}
        aria-label={t`${label} ${amount} ${unit}. Press to enter a value; arrow keys change it by ${words}.`}
        onKeyDown={key}
        onPointerDown={(event) => {
          if (why) return;
          rolled.current = false;
          drag.current = { x: event.clientX, done: 0 };
          event.currentTarget.setPointerCapture(event.pointerId);
        }}
        onPointerMove={move}
        onPointerUp={() => (drag.current = null)}
        onPointerCancel={() => (drag.current = null)}
        onClick={() => {
          if (!rolled.current) onOpen();
          rolled.current = false;
        }}
      >
        {amount} <span className="quiet">{unit}</span>
      </button>
      <Button className="axis-step" aria-label={t`Increase ${label} by ${words}`} why={why} onPress={() => onSteps(1)}>
        +
      </Button>
    </div>
  );
}
