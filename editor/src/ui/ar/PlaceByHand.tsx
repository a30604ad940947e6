/** Place the workplace by hand: drag it in the picture with one or two fingers, or move it in steps. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import type { Point } from "../../ar/geometry";
import type { Direction } from "../../ar/placing";
import { resetPlacing } from "../../commands/ar";
import type { Engine } from "../../engine/engine";
import { getState } from "../../store/store";
import type { Ar } from "../../store/ui";
import { Button } from "../kit/kit";

const DEGREE = Math.PI / 180;
/** Sizes of a step, mm and degrees. */
const STEPS = [
  [1, 0.1],
  [10, 1],
  [100, 10],
] as const;

const BUTTONS: [Direction, string, MessageDescriptor][] = [
  ["turnLeft", "↺", msg`Turn left`],
  ["away", "↑", msg`Away`],
  ["turnRight", "↻", msg`Turn right`],
  ["up", "△", msg`Up`],
  ["left", "←", msg`Left`],
  ["closer", "↓", msg`Closer`],
  ["right", "→", msg`Right`],
  ["down", "▽", msg`Down`],
];

export function PlaceByHand({ engine, ar }: { engine: Engine; ar: Ar }) {
  const [size, setSize] = useState(1);
  useEffect(() => followFingers(engine.view.element), [engine]);
  const [distance, angle] = STEPS[size] as (typeof STEPS)[number];
  const hand = ar.phase === "hand";
  const act = (change: () => void) => () => {
    change();
    getState().runtime.ar?.keepPlacement();
  };
  const tilt = (sign: number) => act(() => getState().runtime.ar?.tilt(sign * angle * DEGREE));
  return (
    <div className="ar-placing" role="group" aria-label={t`Place the workplace`}>
      <p className="small">{t`Drag to move. Two fingers turn and zoom.`}</p>
      {BUTTONS.map(([direction, sign, words]) => (
        <Button
          key={direction}
          aria-label={i18n._(words)}
          onPress={act(() =>
            getState().runtime.ar?.step(direction, { distance: distance / 1000, angle: angle * DEGREE }),
          )}
        >
          {sign}
        </Button>
      ))}
      {hand && ar.mode === "camera" && (
        <>
          <Button className="wide" onPress={tilt(1)}>{t`Camera up`}</Button>
          <Button className="wide" onPress={tilt(-1)}>{t`Camera down`}</Button>
        </>
      )}
      <Button className="wide" onPress={() => setSize((size + 1) % STEPS.length)}>
        {`${distance} mm · ${angle}°`}
      </Button>
      {(hand || ar.nudge) && <Button className="wide" onPress={resetPlacing}>{t`Reset`}</Button>}
    </div>
  );
}

/** Move the workplace with the fingers on the view; return a function that stops it. */
function followFingers(view: HTMLElement): () => void {
  const fingers = new Map<number, Point>();
  const ending = new AbortController();
  const at = (event: PointerEvent): Point => {
    const box = view.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const points = () => [...fingers.values()].slice(0, 2);
  const down = (event: PointerEvent) => {
    view.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
  };
  const move = (event: PointerEvent) => {
    if (!fingers.has(event.pointerId)) return;
    const before = points();
    fingers.set(event.pointerId, at(event));
    getState().runtime.ar?.drag(before, points());
  };
  const up = (event: PointerEvent) => {
    if (fingers.delete(event.pointerId)) getState().runtime.ar?.keepPlacement();
  };
  view.addEventListener("pointerdown", down, ending);
  view.addEventListener("pointermove", move, ending);
  view.addEventListener("pointerup", up, ending);
  view.addEventListener("pointercancel", up, ending);
  return () => ending.abort();
}
