/** Commands for an action: try, run to it, rename, duplicate, remove; and the results of the last tries. */

import { t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { notPredictable, startDryRun } from "../../commands/dryRun";
import { startPicking } from "../../commands/functions";
import { stopMotion } from "../../commands/operation";
import { duplicateAction, notEditable, removeAction, renameAction } from "../../commands/program";
import { breakAt, cancel, execute, notRunnable, runTo } from "../../commands/run";
import { ago } from "../../formats";
import { calledBy, metaOf } from "../../program/logic";
import { isParallel, parallelOf } from "../../program/parallel";
import { whyUnavailable } from "../../store/permissions";
import { select, setUi, useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { Values } from "./Values";
import "./program.css";

const ActionCommands: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const [renaming, setRenaming] = useState(false);
  const { doc, types, live, singleResults, breakpoints } = state;
  const action = doc?.actions[id];
  if (!doc || !action) return null;
  const meta = metaOf(types, doc, action);
  const why = notEditable(state, "RemoveAction");
  const owner = doc.actions[parallelOf(doc).get(id) ?? ""];
  const cannotRemove =
    why || (owner ? t`${action.name} is a branch of ${owner.name}. Select ${owner.name} to change it.` : "");
  const cannotDuplicate = why || (isParallel(action) ? t`Parallel work cannot be duplicated.` : "");
  const running = live.executing === id;
  const cannotTry =
    notEditable(state, "ExecuteAction") ||
    (calledBy(doc, action) || isParallel(action) ? t`Run the project to run a function.` : "") ||
    (live.state !== "started"
      ? t`Go online first. The action runs on the devices.`
      : live.executing
        ? t`Another action is running.`
        : "");
  const pick = () => {
    select(null);
    startPicking([id]);
  };
  const predict = () => {
    setUi({ tool: "run" });
    void startDryRun({ from_action: id });
  };
  const cannotDryRun = doc.path.length > 0 ? t`A dry run starts in the program, not in a function.` : "";
  const cannotRun = doc.project?.has_logic ? notRunnable(state) : t`The project has no program.`;
  return (
    <>
      <div className="row">
        {running ? (
          <Button icon="close" onPress={() => void (meta?.meta.cancellable ? cancel() : stopMotion())}>
            {meta?.meta.cancellable ? t`Cancel` : t`Stop all`}
          </Button>
        ) : (
          <Button icon="play" why={cannotTry} onPress={() => void execute(id)}>
            {t`Try`}
          </Button>
        )}
        <Button icon="play" why={cannotRun} onPress={() => void runTo(id)}>
          {t`Run to here`}
        </Button>
        {doc.project?.has_logic && (
          <Button icon="eye" why={notPredictable(state) || cannotDryRun} onPress={predict}>
            {t`Dry run from here`}
          </Button>
        )}
        <Button
          aria-pressed={id in breakpoints}
          why={whyUnavailable(state, "SetBreakpoints")}
          onPress={() => void breakAt(id, !(id in breakpoints))}
        >
          <span className="breakpoint-dot" data-on={id in breakpoints} aria-hidden="true" />{" "}
          {t`Pause before this action`}
        </Button>
      </div>
      {running && (
        <p role="status">
          <span className="spinner" aria-hidden="true" /> {t`Running…`}
        </p>
      )}
      {singleResults
        .filter((each) => each.action_id === id)
        .slice(-3)
        .reverse()
        .map((each) => (
          <div key={each.time} className={`outcome ${each.error ? "bad" : "good"}`} role="status">
            <strong>{each.error ? t`Failed` : t`Done`}</strong>{" "}
            <span className="quiet small">{ago(new Date(each.time).toISOString())}</span>
            {each.error && <p>{each.error}</p>}
            {each.results && each.results.length > 0 && (
              <Values names={action.flows[0]?.outputs ?? []} values={each.results} />
            )}
          </div>
        ))}
      {renaming ? (
        <Rename id={id} name={action.name} onClose={() => setRenaming(false)} />
      ) : (
        <div className="row">
          <Button variant="plain" why={why} onPress={() => setRenaming(true)}>
            {t`Rename`}
          </Button>
          {doc.project?.has_logic && !owner && (
            <Button variant="plain" why={notEditable(state, "MakeFunction")} onPress={pick}>
              {t`Make a function`}
            </Button>
          )}
          <Button variant="plain" why={cannotDuplicate} onPress={() => void duplicateAction(action)}>
            {t`Duplicate`}
          </Button>
          <Button variant="plain" why={cannotRemove} onPress={() => void removeAction(id)}>
            {t`Remove`}
          </Button>
        </div>
      )}
    </>
  );
};
export default ActionCommands;

function Rename({ id, name, onClose }: { id: string; name: string; onClose: () => void }) {
  const [text, setText] = useState(name);
  const [problem, setProblem] = useState("");
  const submit = async (event: FormEvent) => {
    event.preventDefault();
    const wanted = text.trim();
    const refused = wanted === name ? "" : await renameAction(id, wanted);
    setProblem(refused);
    if (!refused) onClose();
  };
  return (
    <form onSubmit={(event) => void submit(event)} onKeyDown={(event) => event.key === "Escape" && onClose()}>
      <Field label={t`New name`} value={text} onChange={setText} autoFocus autoComplete="off" />
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="row">
        <Button variant="primary" type="submit" isDisabled={text.trim() === ""}>
          {t`Rename`}
        </Button>
        <Button onPress={onClose}>{t`Cancel`}</Button>
      </div>
    </form>
  );
}
