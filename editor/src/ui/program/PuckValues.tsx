/** The values of a call next to its puck in the 3D view. A tap opens their fields there. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import { bearingOf } from "../../engine/bearing";
import { overlap } from "../../engine/clusters";
import type { Engine } from "../../engine/engine";
import { calledBy } from "../../program/operands";
import { runnerOf } from "../../program/parallel";
import { valuesOf } from "../../program/step";
import { useEditor } from "../../store/store";
import { controlAreas } from "../aim/OffScreen";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import ActionParameters from "./ActionParameters";
import "./puck.css";

/** Distance from the puck, and from the edge of the view, pixels. */
const AWAY = 26;
const EDGE = 6;
/** Height of the view in which the fields fit; on phones, those of the panel below it are shown. */
const HIGH = 440;

export default function PuckValues({ engine }: { engine: Engine }) {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const id = useEditor(({ ui }) => (ui.selection?.kind === "action" ? ui.selection.id : ""));
  const action = doc?.actions[id];
  if (!doc || !action || !calledBy(doc, action) || action.parameters.length === 0) return null;
  return (
    <Values
      key={id}
      engine={engine}
      id={id}
      name={action.name}
      puck={runnerOf(doc, id)}
      values={valuesOf(doc, types, action)}
    />
  );
}

interface ValuesProps {
  engine: Engine;
  id: string;
  name: string;
  /** Id of the action with the puck: the parallel action for its calls. */
  puck: string;
  values: string;
}

function Values({ engine, id, name, puck, values }: ValuesProps) {
  const [open, setOpen] = useState(false);
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const place = () => {
      const element = box.current;
      const view = element?.closest(".view")?.getBoundingClientRect();
      if (!element || !view) return;
      const at = bearingOf(engine, puck);
      const { offsetWidth: width, offsetHeight: height } = element;
      const others = controlAreas(view, element);
      // Below the puck, if possible; otherwise next to it, or above its name.
      const places = at?.inView
        ? [
            [at.x - width / 2, at.y + AWAY],
            [at.x + AWAY, at.y - height / 2],
            [at.x - AWAY - width, at.y - height / 2],
            [at.x - width / 2, at.y - 2 * AWAY - height],
          ]
        : [];
      const found = places
        .map(([x = 0, y = 0]) => ({
          left: Math.max(EDGE, Math.min(x, view.width - width - EDGE)),
          top: Math.max(EDGE, Math.min(y, view.height - height - EDGE)),
        }))
        .find(({ left, top }) => {
          const rect = { left, top, right: left + width, bottom: top + height };
          return !others.some((other) => overlap(rect, other));
        });
      element.style.visibility = found ? "" : "hidden";
      if (found) element.style.transform = `translate(${Math.round(found.left)}px, ${Math.round(found.top)}px)`;
    };
    place();
    const resized = new ResizeObserver(() => {
      place();
      engine.invalidate(); // the names make room
    });
    if (box.current) resized.observe(box.current);
    const end = engine.watch(place);
    return () => {
      resized.disconnect();
      end();
      engine.invalidate();
    };
  }, [engine, puck]);
  const show = () => {
    if ((box.current?.closest(".view")?.clientHeight ?? 0) >= HIGH) setOpen(true);
    else document.querySelector('.panel [data-section="parameters"]')?.scrollIntoView();
  };
  return (
    <div ref={box} className="puck-values" data-open={open} role="group" aria-label={t`Values of ${name}`}>
      {open ? (
        <>
          <div className="puck-head">
            <strong>{name}</strong>
            <Button variant="plain" icon="close" aria-label={t`Close the values`} onPress={() => setOpen(false)} />
          </div>
          <div className="puck-fields">
            <ActionParameters selection={{ kind: "action", id }} />
          </div>
        </>
      ) : (
        <Button variant="plain" onPress={show}>
          <Icon name="function" size={16} />
          <span className="puck-words">{values || t`Parameters`}</span>
        </Button>
      )}
    </div>
  );
}
