/** The result of the last run of a project, with its error and a button that shows the failed action. */

import { t } from "@lingui/core/macro";
import { ago } from "../../formats";
import { lastRun, type Result, resultOf } from "../../program/results";
import { theEngine } from "../../session/engine";
import { getState, select, setUi, useEditor } from "../../store/store";
import { nameOf, selectionOf, withNames } from "../../viewmodel/names";
import { Icon, type IconName } from "../kit/icons";
import { Button } from "../kit/kit";
import { useTicking } from "../times";

export const ICONS: Record<Result["tone"], IconName> = { good: "check", bad: "warn", warn: "warn", "": "stop" };

export function LastResult({ projectId }: { projectId: string }) {
  const run = useEditor((state) => lastRun(state, projectId));
  const result = resultOf(run);
  useTicking();
  if (!run || !result) return <p className="run-state">{t`Not run yet`}</p>;
  return (
    <section className={`last-result ${result.tone}`} aria-label={t`Last run`}>
      <p>
        <Icon name={ICONS[result.tone]} /> <strong>{result.title}</strong>{" "}
        <span className="small">{ago(run.ended ?? run.started)}</span>
      </p>
      {result.detail && <p>{withNames(getState(), result.detail)}</p>}
      {result.tone === "bad" && <ShowAction id={result.actionId} />}
    </section>
  );
}

/** A button that selects an action of the open project; nothing if the project is not open. */
export function ShowAction({ id }: { id: string }) {
  const name = useEditor((state) => (id ? nameOf(state, id) : ""));
  if (!name) return null;
  const show = () => {
    setUi({ tool: "" });
    select(selectionOf(getState(), id));
    theEngine()?.focus(id);
  };
  return (
    <Button icon="zoom" onPress={show}>
      {t`Show ${name}`}
    </Button>
  );
}
