/** The Stop button. It acts on press, not on release. It stops motion by software and is not an emergency stop. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import { stopMotion } from "../../commands/operation";
import { useEditor } from "../../store/store";

/** Longest interval between two presses of Escape that together stop motion, ms. */
const TWICE = 700;

export function StopMotion() {
  const connected = useEditor((state) => ["ready", "person"].includes(state.connection.status));
  const [stopping, setStopping] = useState(false);
  const stop = () => {
    setStopping(true);
    void stopMotion().finally(() => setTimeout(() => setStopping(false), 400));
  };
  const latest = useRef(stop);
  latest.current = stop;
  useEffect(() => {
    let before = -Infinity;
    // Captured, because an open dialog or menu also handles Escape.
    const key = (event: KeyboardEvent) => {
      if (event.key !== "Escape" || event.repeat) return;
      if (event.timeStamp - before < TWICE) latest.current();
      before = event.timeStamp;
    };
    window.addEventListener("keydown", key, { capture: true });
    return () => window.removeEventListener("keydown", key, { capture: true });
  }, []);
  return (
    <button
      type="button"
      className="stop"
      aria-keyshortcuts="Escape"
      data-stopping={stopping}
      disabled={!connected}
      onPointerDown={(event) => {
        if (event.button === 0) stop();
      }}
      onKeyDown={(event) => {
        if (!event.repeat && (event.key === "Enter" || event.key === " ")) stop();
      }}
      // Screen readers send a click without pointer or key events.
      onClick={(event) => {
        if (event.detail === 0 && !stopping) stop();
      }}
    >
      <svg width="34" height="34" viewBox="0 0 34 34" aria-hidden="true">
        <path d="M11 2h12l9 9v12l-9 9H11l-9-9V11z" fill="none" stroke="currentColor" strokeWidth="3" />
        <rect x="11" y="11" width="12" height="12" rx="1.500" fill="currentColor" />
      </svg>
      <span>
        <strong>{stopping ? t`Stopping…` : t`Stop motion`}</strong>
        <small>
          {connected ? (
            <>
              {t`Not an emergency stop`}
              <span className="stop-key"> {t`· Esc twice`}</span>
            </>
          ) : (
            t`No connection: use the emergency stop`
          )}
        </small>
      </span>
    </button>
  );
}
