/** The cross in the middle of the view, what it means, and the next that it may mean. */

import { useEffect, useRef } from "react";
import { keepGeneral } from "../../commands/viewstate";
import { bearingOf } from "../../engine/bearing";
import type { Engine } from "../../engine/engine";
import { followCross, nextCandidate, useAiming } from "../../session/aiming";
import { now, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { KINDS, nameOf, selectionOf } from "../names";
import { writing } from "../search/Overlays";
import { pick } from "../workplace/pick";

const NOTHING = "Nothing is near the cross: turn the view.";

export function takeCandidate(): void {
  const { chosen } = useAiming.getState();
  if (chosen) pick([chosen]);
}

export function Aim({ engine }: { engine: Engine }) {
  const { candidates, chosen, listed } = useAiming();
  const name = useEditor((state) => nameOf(state, chosen));
  const mark = useRef<HTMLSpanElement>(null);
  useEffect(
    () =>
      followCross(engine, () => {
        const { chosen: at } = useAiming.getState();
        const place = at ? bearingOf(engine, at) : null;
        if (!mark.current) return;
        mark.current.style.visibility = place?.inView ? "visible" : "hidden";
        if (place)
          mark.current.style.transform = `translate(${place.x.toFixed(1)}px, ${place.y.toFixed(1)}px) translate(-50%, -50%)`;
      }),
    [engine],
  );
  // Another candidate by key or tap: its name and mark are drawn now.
  useEffect(() => engine.invalidate(), [engine, chosen]);
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || writing(event.target) || document.querySelector(".overlay"))
        return;
      if (event.key.toLowerCase() === "n") nextCandidate(event.shiftKey ? -1 : 1);
      // Enter is that of what has the focus, but of the view.
      else if (event.key === "Enter" && event.target instanceof Element && event.target.matches("body, .view canvas"))
        takeCandidate();
      else return;
      event.preventDefault();
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  const kind = selectionOf(now(), chosen)?.kind;
  const at = candidates.indexOf(chosen) + 1;
  return (
    <>
      <span className="view-cross" aria-hidden="true" />
      <span ref={mark} className="aim-mark" aria-hidden="true" />
      <div className="aim-bar" role="group" aria-label="At the cross">
        <span className="aim-name" role="status">
          {kind ? (
            <>
              {name} <small className="quiet">{KINDS[kind]}</small>
            </>
          ) : (
            <small className="quiet">Nothing near</small>
          )}
        </span>
        <Button
          look="primary"
          aria-label={name ? `Select ${name}` : "Select"}
          why={chosen ? "" : NOTHING}
          onPress={takeCandidate}
        >
          Select
        </Button>
        <Button
          aria-label={`Next ${at}/${candidates.length}, of what is at the cross`}
          aria-keyshortcuts="N"
          why={candidates.length > 1 ? "" : chosen ? "Nothing else is near the cross." : NOTHING}
          onPress={() => nextCandidate()}
        >
          Next{" "}
          <small>
            {at}/{candidates.length}
          </small>
        </Button>
        {!listed && (
          <Button
            look="plain"
            icon="close"
            aria-label="No more picking by the cross"
            onPress={() => keepGeneral({ aiming: null })}
          />
        )}
      </div>
    </>
  );
}
