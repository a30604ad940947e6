/** The crosshair in the middle of the view, and its candidates. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useRef } from "react";
import { storeGeneralState } from "../../commands/viewstate";
import { bearingOf } from "../../engine/bearing";
import type { Engine } from "../../engine/engine";
import { followCrosshair, nextCandidate } from "../../session/aiming";
import { getState, useEditor } from "../../store/store";
import { kindName, nameOf, selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import { isTyping } from "../search/overlay";
import { pick } from "../workplace/pick";

const NOTHING = msg`Nothing at the crosshair. Turn the view.`;

function selectCandidate(): void {
  const { chosen } = getState().ui.crosshair;
  if (chosen) pick([chosen]);
}

export function Aim({ engine }: { engine: Engine }) {
  const { candidates, chosen, listed } = useEditor((state) => state.ui.crosshair);
  const name = useEditor((state) => nameOf(state, chosen));
  const mark = useRef<HTMLSpanElement>(null);
  useEffect(
    () =>
      followCrosshair(engine, () => {
        const { chosen: at } = getState().ui.crosshair;
        const place = at ? bearingOf(engine, at) : null;
        if (!mark.current) return;
        mark.current.style.visibility = place?.inView ? "visible" : "hidden";
        if (place) {
          const [x, y] = [place.x.toFixed(1), place.y.toFixed(1)];
          mark.current.style.transform = `translate(${x}px, ${y}px) translate(-50%, -50%)`;
        }
      }),
    [engine],
  );
  // Another candidate was chosen: draw its name and marker.
  useEffect(() => engine.invalidate(), [engine, chosen]);
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      if (
        event.ctrlKey ||
        event.metaKey ||
        event.altKey ||
        isTyping(event.target) ||
        document.querySelector(".overlay")
      )
        return;
      if (event.key.toLowerCase() === "n") nextCandidate(event.shiftKey ? -1 : 1);
      // Enter belongs to the focused element, except for the view.
      else if (event.key === "Enter" && event.target instanceof Element && event.target.matches("body, .view canvas"))
        selectCandidate();
      else return;
      event.preventDefault();
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  const kind = selectionOf(getState(), chosen)?.kind;
  const at = candidates.indexOf(chosen) + 1;
  return (
    <>
      <span className="view-cross" aria-hidden="true" />
      <span ref={mark} className="aim-mark" aria-hidden="true" />
      <div className="aim-bar" role="group" aria-label={t`At the crosshair`}>
        <span className="aim-name" role="status">
          {kind ? (
            <>
              {name} <small className="quiet">{kindName(kind)}</small>
            </>
          ) : (
            <small className="quiet">{t`Nothing here`}</small>
          )}
        </span>
        <Button
          variant="primary"
          aria-label={name ? t`Select ${name}` : t`Select`}
          why={chosen ? "" : i18n._(NOTHING)}
          onPress={selectCandidate}
        >
          {t`Select`}
        </Button>
        <Button
          aria-label={t`Next ${at}/${candidates.length} at the crosshair`}
          aria-keyshortcuts="N"
          why={candidates.length > 1 ? "" : chosen ? t`Nothing else is at the crosshair.` : i18n._(NOTHING)}
          onPress={() => nextCandidate()}
        >
          {t`Next`}{" "}
          <small>
            {at}/{candidates.length}
          </small>
        </Button>
        {!listed && (
          <Button
            variant="plain"
            icon="close"
            aria-label={t`Close the crosshair`}
            onPress={() => storeGeneralState({ aiming: null })}
          />
        )}
      </div>
    </>
  );
}
