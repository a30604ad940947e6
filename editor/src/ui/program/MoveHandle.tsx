/** Move an action in the list: drag its handle, tap it and press up or down, or use the arrow keys. */

import { t } from "@lingui/core/macro";
import { type PointerEvent, useRef, useState } from "react";
import { moveAction } from "../../commands/moving";
import { Drawing } from "../kit/icons";
import { Button } from "../kit/kit";

const GRIP = "M9 6v.01M15 6v.01M9 12v.01M15 12v.01M9 18v.01M15 18v.01";
const UP = "M6 15l6-6 6 6";
const DOWN = "M6 9l6 6 6-6";
/** Distance from which a press is a drag, pixels. */
const DRAGGED = 6;

/** An action that is being dragged: it would be placed before or after another one. */
export interface Drag {
  id: string;
  over: string;
  side: "before" | "after";
}

interface MoveHandleProps {
  id: string;
  name: string;
  /** The actions among which it can be moved, in their order. */
  run: readonly string[];
  drag: Drag | null;
  onDrag: (drag: Drag | null) => void;
}

export function MoveHandle({ id, name, run, drag, onDrag }: MoveHandleProps) {
  const [open, setOpen] = useState(false);
  const from = run.indexOf(id);
  const pressed = useRef<number | null>(null);
  const move = (to: number) => void (to >= 0 && to < run.length && moveAction(id, to));

  const down = (event: PointerEvent<HTMLButtonElement>) => {
    pressed.current = event.clientY;
    event.currentTarget.setPointerCapture(event.pointerId);
  };
  const over = (event: PointerEvent) => {
    if (pressed.current === null) return;
    if (drag === null && Math.abs(event.clientY - pressed.current) < DRAGGED) return;
    const row = document
      .elementsFromPoint(event.clientX, event.clientY)
      .find((each) => each.matches(".steps li"))
      ?.getAttribute("data-action");
    const to = run.indexOf(row ?? "");
    onDrag(
      to < 0 || to === from
        ? { id, over: "", side: "before" }
        : { id, over: run[to] ?? "", side: to > from ? "after" : "before" },
    );
  };
  const up = () => {
    const to = run.indexOf(drag?.over ?? "");
    if (pressed.current !== null && drag === null) setOpen(!open);
    pressed.current = null;
    if (drag?.id === id && to >= 0) move(to);
    onDrag(null);
  };
  return (
    <>
      {open && (
        <>
          <Button
            variant="plain"
            className="move-here"
            aria-label={t`Move ${name} up`}
            isDisabled={from === 0}
            onPress={() => move(from - 1)}
          >
            <Drawing path={UP} />
          </Button>
          <Button
            variant="plain"
            className="move-here"
            aria-label={t`Move ${name} down`}
            isDisabled={from === run.length - 1}
            onPress={() => move(from + 1)}
          >
            <Drawing path={DOWN} />
          </Button>
        </>
      )}
      <button
        type="button"
        className="move"
        aria-label={t`Move ${name}`}
        aria-expanded={open}
        onPointerDown={down}
        onPointerMove={over}
        onPointerUp={up}
        onPointerCancel={() => {
          pressed.current = null;
          onDrag(null);
        }}
        onClick={(event) => event.detail === 0 && setOpen(!open)}
        onKeyDown={(event) => {
          if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
          event.preventDefault();
          move(from + (event.key === "ArrowUp" ? -1 : 1));
        }}
      >
        <Drawing path={GRIP} />
      </button>
    </>
  );
}
