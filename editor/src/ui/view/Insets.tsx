/** Small views of the surroundings of the selected item from above and from the side. A tap turns the view that way. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import type { Engine } from "../../engine/engine";
import { drawInset, nearestSide, regionOf, type Side } from "../../engine/insets";
import { decimal } from "../../formats";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { SIDES } from "./sides";

interface InsetsProps {
  engine: Engine;
  onLook: (side: Side) => void;
  onClose: () => void;
}

export default function Insets({ engine, onLook, onClose }: InsetsProps) {
  const id = useEditor((state) => state.ui.selection?.id ?? "");
  const name = useEditor((state) => nameOf(state, id));
  const group = useRef<HTMLDivElement>(null);
  const [shown, setShown] = useState({ side: "front" as Side, height: 0 });
  useEffect(() => {
    const draw = () => {
      const view = engine.view.element.getBoundingClientRect();
      const region = regionOf(engine, id);
      const side = nearestSide(engine.view.camera.position, engine.view.target);
      for (const each of group.current?.querySelectorAll<HTMLElement>("[data-side]") ?? []) {
        const { left, top, right, bottom } = each.getBoundingClientRect();
        const box = {
          left: left - view.left,
          right: right - view.left,
          top: top - view.top,
          bottom: bottom - view.top,
        };
        drawInset(engine, each.dataset.side === "top" ? "top" : side, region, box, view);
      }
      const height = Math.round(region.half * 200) / 100;
      setShown((before) => (before.side === side && before.height === height ? before : { side, height }));
    };
    const end = engine.watch(draw);
    engine.invalidate();
    return () => {
      end();
      engine.invalidate();
    };
  }, [engine, id]);
  const words = (side: Side) => SIDES.filter(([each]) => each === side).map(([, name]) => i18n._(name))[0] ?? "";
  return (
    <div ref={group} className="insets" role="group" aria-label={t`Top and side views of ${name || t`the middle`}`}>
      {(["top", shown.side] as const).map((side) => (
        <button
          key={side === "top" ? "top" : "side"}
          type="button"
          className="inset"
          aria-label={t`View: ${words(side)}`}
          onClick={() => onLook(side)}
        >
          <span className="inset-picture" data-side={side === "top" ? "top" : "other"} />
          <span className="inset-words">
            {words(side)} <span className="quiet">↕ {decimal(shown.height, 2)} m</span>
          </span>
        </button>
      ))}
      <button type="button" className="inset-close" aria-label={t`Close top and side views`} onClick={onClose}>
        <Icon name="close" />
      </button>
    </div>
  );
}
