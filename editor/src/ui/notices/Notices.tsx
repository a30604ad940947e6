/**
 * The tray: work that takes its time, and what the server or a device has said. Nothing of it blocks; errors stay
 * until somebody has seen them, the rest goes by itself.
 */

import { useEffect } from "react";
import { dismiss, store, useEditor } from "../../store/store";
import { without } from "../../store/records";
import type { TaskStateData } from "../../protocol/types";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { openOverlay } from "../search/Overlays";
import "./notices.css";

/** s that what is no error stays. */
const STAY = 6;
/** So many are shown at once, the newest. */
const SHOWN = 3;

export function Notices() {
  const notices = useEditor((state) => state.notices);
  const tasks = useEditor((state) => state.tasks);
  const passing = notices.find((each) => each.level !== "error");
  useEffect(() => {
    if (!passing) return;
    const timer = setTimeout(() => dismiss(passing.id), Math.max(0, passing.time + STAY * 1000 - Date.now()));
    return () => clearTimeout(timer);
  }, [passing]);
  return (
    <section className="tray" aria-label="Tasks and messages" aria-live="polite">
      {current(Object.values(tasks))
        .filter((each) => each.state !== "cancelled")
        .map((each) => (
          <Task key={each.id} task={each} />
        ))}
      {notices.slice(-SHOWN).map((each) => (
        <div key={each.id} className={`notice ${each.level}`} role={each.level === "error" ? "alert" : undefined}>
          <Icon name={each.level === "info" ? "info" : "warn"} />
          <p>{each.text}</p>
          <Button look="plain" icon="close" aria-label="Dismiss" onPress={() => dismiss(each.id)} />
        </div>
      ))}
      {notices.length > SHOWN && (
        <Button className="notices-before" onPress={() => openOverlay("messages")}>
          and {notices.length - SHOWN} before
        </Button>
      )}
    </section>
  );
}

/** What was begun anew takes the place of what has failed before, or is over. */
function current(tasks: TaskStateData[]): TaskStateData[] {
  return tasks.filter((each, n) => each.state === "running" || !tasks.slice(n + 1).some(({ kind, title }) => kind === each.kind && title === each.title));
}

function Task({ task }: { task: TaskStateData }) {
  const { id, title, state, progress, message, started_by: by } = task;
  const over = state !== "running";
  useEffect(() => {
    if (state !== "finished") return;
    const timer = setTimeout(() => store.setState((now) => ({ tasks: without(now.tasks, id) })), STAY * 500);
    return () => clearTimeout(timer);
  }, [id, state]);
  return (
    <div className={`notice task ${state === "failed" ? "error" : ""}`} data-state={state}>
      {state === "running" ? <span className="spinner" aria-hidden="true" /> : <Icon name={state === "failed" ? "warn" : "check"} />}
      <div>
        <p>
          {title}
          {by && <span className="quiet small"> · {by}</span>}
        </p>
        {message && <p className="quiet small">{message}</p>}
        {!over && progress !== undefined && <progress value={progress} max={1} aria-label={title} />}
      </div>
      {over && <Button look="plain" icon="close" aria-label="Dismiss" onPress={() => store.setState((now) => ({ tasks: without(now.tasks, id) }))} />}
    </div>
  );
}
