/** Calibrations of an object, newest first, and the running one. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { type CalibrationRecord, recordsOf, verdictOf } from "../../commands/calibrate";
import { dateAndTime, fixed } from "../../formats";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { BeforeAfter } from "./BeforeAfter";
import "./calibrate.css";

export function Records({ id }: { id: string }) {
  const name = useEditor((state) => nameOf(state, id));
  const task = useEditor((state) =>
    Object.values(state.tasks).findLast((each) => each.kind === "calibration" && each.title.includes(name)),
  );
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
              ? t`Failed: ${task.message ?? ""}`
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
