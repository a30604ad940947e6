/** Calibrations of an object, newest first, and the one that is running or has ended while they are shown. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { type CalibrationRecord, recordsOf, verdictOf } from "../../commands/calibrate";
import { ago, dateAndTime, fixed } from "../../formats";
import type { State } from "../../store/state";
import { getState, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { useTicking } from "../times";
import { BeforeAfter } from "./BeforeAfter";
import "./calibrate.css";

const endedTasks = ({ tasks }: State): ReadonlySet<string> =>
  new Set(Object.keys(tasks).filter((id) => tasks[id]?.state !== "running"));

export function Records({ id }: { id: string }) {
  const name = useEditor((state) => nameOf(state, id));
  // The cause of an earlier failure may have been removed in the meantime, for example by configuring markers.
  const [before] = useState(() => endedTasks(getState()));
  const task = useEditor((state) =>
    Object.values(state.tasks).findLast(
      (each) => each.kind === "calibration" && each.title.includes(name) && !before.has(each.id),
    ),
  );
  useTicking();
  const [records, setRecords] = useState<CalibrationRecord[]>([]);
  const state = task?.state ?? "";
  useEffect(() => {
    let over = false;
    recordsOf(id).then(
      (found) => over || setRecords(found),
      () => over || setRecords([]), // an older server stores none
    );
    return () => {
      over = true;
    };
  }, [id, state]);
  return (
    <>
      {task && (
        <p className={`small ${state === "failed" ? "error" : ""}`} role="status">
          {state === "running"
            ? t`In progress: ${task.message ?? ""}`
            : state === "failed"
              ? t`Failed ${ago(task.started)}: ${task.message ?? ""}`
              : task.message}
        </p>
      )}
      <BeforeAfter id={id} />
      {records.length > 0 && (
        <ul className="records" aria-label={t`Calibration history`}>
          {records.map((each) => (
            <li key={each.id}>
              <span>{verdictOf(each)}</span>
              <span className="quiet small">
                {dateAndTime(each.date)} · {each.person}
                {each.residual !== undefined && ` · ${fixed(each.residual, 2)} ${each.residual_unit ?? ""}`}
              </span>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}
