/**
 * The newest message and the newest task. Errors stay until they are dismissed, other messages disappear by themselves.
 *
 * They have a space of their own, so that they never cover a control: a row of the screen, or a part of the Stop dock
 * while something may move. A tap shows all messages with the addresses of devices, which only technicians need.
 */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { splitAddress } from "../../program/messages";
import type { TaskStateData } from "../../protocol/types";
import { without } from "../../store/records";
import { isLive } from "../../store/selectors";
import { dismiss, store, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { openOverlay } from "../search/overlay";
import "./notices.css";

/** Time for which a message that is not an error is shown, s. */
const STAY = 6;

export function Notices({ docked = false }: { docked?: boolean }) {
  const notices = useEditor((state) => state.notices);
  const tasks = useEditor((state) => state.tasks);
  const live = useEditor(isLive);
  const passing = notices.find((each) => each.level !== "error");
  useEffect(() => {
    if (!passing) return;
    const timer = setTimeout(() => dismiss(passing.id), Math.max(0, passing.time + STAY * 1000 - Date.now()));
    return () => clearTimeout(timer);
  }, [passing]);
  if (live !== docked) return null;
  const newest = notices.at(-1);
  const more = notices.length - 1;
  const task = current(Object.values(tasks))
    .filter((each) => each.state !== "cancelled")
    .at(-1);
  return (
    <section className={docked ? "notices docked" : "notices"} aria-label={t`Tasks and messages`} aria-live="polite">
      {task && <Task key={task.id} task={task} />}
      {newest && (
        <div key={newest.id} className={`notice ${newest.level}`} role={newest.level === "error" ? "alert" : undefined}>
          <Icon name={newest.level === "info" ? "info" : "warn"} />
          <button
            type="button"
            className="notice-text"
            title={t`Show all messages`}
            onClick={() => openOverlay("messages")}
          >
            <span>{splitAddress(newest.text).text}</span>
            {more > 0 && <span className="tag">+{more}</span>}
          </button>
          <Button variant="plain" icon="close" aria-label={t`Dismiss`} onPress={() => dismiss(newest.id)} />
        </div>
      )}
    </section>
  );
}

/** Leave out finished tasks that were started again. */
function current(tasks: TaskStateData[]): TaskStateData[] {
  return tasks.filter(
    (each, n) =>
      each.state === "running" ||
      !tasks.slice(n + 1).some(({ kind, title }) => kind === each.kind && title === each.title),
  );
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
      {state === "running" ? (
        <span className="spinner" aria-hidden="true" />
      ) : (
        <Icon name={state === "failed" ? "warn" : "check"} />
      )}
      <div>
        <p>
          {title}
          {by && <span className="quiet small"> · {by}</span>}
        </p>
        {message && <p className="quiet small">{message}</p>}
        {!over && progress !== undefined && <progress value={progress} max={1} aria-label={title} />}
      </div>
      {over && (
        <Button
          variant="plain"
          icon="close"
          aria-label={t`Dismiss`}
          onPress={() => store.setState((now) => ({ tasks: without(now.tasks, id) }))}
        />
      )}
    </div>
  );
}
