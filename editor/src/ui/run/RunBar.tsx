/** State and controls of the running program, shown in the view whichever panel is open. */

import { barred } from "../../commands/asking";
import * as commands from "../../commands/run";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { nameOf } from "../names";

export const STATES: Record<string, string> = {
  started: "Starting…",
  running: "Running",
  pausing: "Pausing…",
  paused: "Paused",
  resuming: "Resuming…",
  stopping: "Stopping…",
};

export default function RunBar() {
  const state = useEditor((each) => each);
  const { state: phase, running } = state.program;
  const at = running.map((id) => nameOf(state, id)).filter(Boolean);
  return (
    <div className="runbar" role="group" aria-label="The program">
      <span className="runbar-state" role="status">
        <strong>{STATES[phase]}</strong>
        {at.length > 0 && (
          <span className="small quiet">{phase === "paused" ? ` before ${at.join(", ")}` : ` ${at.join(", ")}`}</span>
        )}
      </span>
      <RunButtons />
    </div>
  );
}

/** Pause, resume, step and stop, as far as the state allows. */
export function RunButtons() {
  const phase = useEditor((state) => state.program.state);
  const why = useEditor((state) => barred(state, "StopPackage"));
  return (
    <>
      {phase === "running" && (
        <Button icon="pause" why={why} onPress={() => void commands.pause()}>
          Pause
        </Button>
      )}
      {phase === "paused" && (
        <>
          <Button icon="play" look="primary" why={why} onPress={() => void commands.resume()}>
            Resume
          </Button>
          <Button icon="step" why={why} onPress={() => void commands.step()}>
            Step
          </Button>
        </>
      )}
      {(phase === "running" || phase === "paused" || phase === "pausing" || phase === "resuming") && (
        <Button icon="stop" why={why} onPress={() => void commands.stop()}>
          Stop
        </Button>
      )}
    </>
  );
}
