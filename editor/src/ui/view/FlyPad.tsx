/** Buttons that fly the camera while they are held, for devices without a keyboard. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import type { PointerEvent } from "react";
import type { View } from "../../engine/camera";
import { Button } from "../kit/kit";

const KEYS: [string, string, MessageDescriptor][] = [
  ["KeyQ", "▽", msg`Down`],
  ["KeyW", "↑", msg`Forward`],
  ["KeyE", "△", msg`Up`],
  ["KeyA", "←", msg`Left`],
  ["KeyS", "↓", msg`Back`],
  ["KeyD", "→", msg`Right`],
];

export function FlyPad({ view, onDone }: { view: View; onDone: () => void }) {
  const hold = (key: string, down: boolean) => (event: PointerEvent<HTMLButtonElement>) => {
    if (down) event.currentTarget.setPointerCapture(event.pointerId);
    view.hold(key, down);
  };
  return (
    <div className="fly-pad" role="group" aria-label={t`Fly`}>
      {KEYS.map(([key, sign, words]) => (
        <button
          key={key}
          type="button"
          className="button"
          aria-label={i18n._(words)}
          onPointerDown={hold(key, true)}
          onPointerUp={hold(key, false)}
          onPointerCancel={hold(key, false)}
          onLostPointerCapture={hold(key, false)}
          onKeyDown={(event) => (event.key === " " || event.key === "Enter") && view.hold(key, true)}
          onKeyUp={() => view.hold(key, false)}
          onBlur={() => view.hold(key, false)}
          onContextMenu={(event) => event.preventDefault()}
        >
          {sign}
        </button>
      ))}
      <Button className="fly-done" onPress={onDone}>
        {t`Done`}
      </Button>
    </div>
  );
}
