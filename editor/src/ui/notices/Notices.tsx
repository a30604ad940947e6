/**
 * Running tasks and messages. Errors stay until they are dismissed, other messages disappear by themselves.
 *
 * While nothing can move, they float above the screen. Otherwise they are shown in the Stop dock, where they cannot
 * cover a control: the newest message and the newest task, each in a fixed space. A tap shows all messages.
 */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import type { TaskStateData } from "../../protocol/types";
import { without } from "../../store/records";
import { isLive } from "../../store/selectors";
import { dismiss, store, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { openOverlay } from "../search/overlay";
import "./notices.css";

/** How long a message that is not an error stays, s. */
const STAY = 6;
/** Number of messages above the screen, newest first. */
const SHOWN = 3;

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
  const shown = current(Object.values(tasks)).filter((each) => each.state !== "cancelled");
  const number = docked ? 1 : SHOWN;
  const more = notices.length - number;
  return (
    <section className={docked ? "docked-notices" : "tray"} aria-label={t`Tasks and messages`} aria-live="polite">
      {shown.slice(docked ? -1 : 0).map((each) => (
        <Task key={each.id} task={each} />
      ))}
      {notices.slice(-number).map((each) => (
        <div key={each.id} className={`notice ${each.level}`} role={each.level === "error" ? "alert" : undefined}>
          <Icon name={each.level === "info" ? "info" : "warn"} />
          {docked ? (
            <button
              type="button"
              className="notice-text"
              title={t`Show all messages`}
              onClick={() => openOverlay("messages")}
            >
              <span>{each.text}</span>
              {more > 0 && <span className="tag">+{more}</span>}
            </button>
          ) : (
            <p>{each.text}</p>
          )}
          <Button look="plain" icon="close" aria-label={t`Dismiss`} onPress={() => dismiss(each.id)} />
        </div>
      ))}
      {!docked && more > 0 && (
        <Button className="notices-before" onPress={() => openOverlay("messages")}>
          {t`${more} more`}
        </Button>
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
          look="plain"
          icon="close"
          aria-label={t`Dismiss`}
          onPress={() => store.setState((now) => ({ tasks: without(now.tasks, id) }))}
        />
      )}
    </div>
  );
}
