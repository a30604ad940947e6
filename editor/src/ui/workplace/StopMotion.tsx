/**
 * The stop: always there while a robot is live or a program runs, past every panel. It acts on press, not on release.
 * It stops motion by software, and says that it is no emergency stop.
 */

import { useState } from "react";
import { stopMotion } from "../../commands/operation";
import { useEditor } from "../../store/store";
import { RUNNING } from "../../store/selectors";

export function StopMotion() {
  const live = useEditor((state) => state.live.state === "started" || state.live.state === "stopping" || RUNNING.has(state.program.state));
  const connected = useEditor((state) => state.connection.status === "ready");
  const [stopping, setStopping] = useState(false);
  if (!live) return null;
  const stop = () => {
    setStopping(true);
    void stopMotion().finally(() => setTimeout(() => setStopping(false), 400));
  };
  return (
    <button
      type="button"
      className="stop"
      data-stopping={stopping}
      disabled={!connected}
      onPointerDown={(event) => {
        if (event.button === 0) stop();
      }}
      onKeyDown={(event) => {
        if (!event.repeat && (event.key === "Enter" || event.key === " ")) stop();
      }}
      // A screen reader presses by a click alone, without pointer or key.
      onClick={(event) => {
        if (event.detail === 0 && !stopping) stop();
      }}
    >
      <svg width="34" height="34" viewBox="0 0 34 34" aria-hidden="true">
        <path d="M11 2h12l9 9v12l-9 9H11l-9-9V11z" fill="none" stroke="currentColor" strokeWidth="3" />
        <rect x="11" y="11" width="12" height="12" rx="1.500" fill="currentColor" />
      </svg>
      <span>
        <strong>{stopping ? "Stopping…" : "Stop motion"}</strong>
        <small>{connected ? "no emergency stop" : "no connection: use the emergency stop"}</small>
      </span>
    </button>
  );
}
