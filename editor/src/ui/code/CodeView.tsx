/** The Python program of the open project: read it, edit it, and import the changes. */

import type { Diagnostic } from "@codemirror/lint";
import { plural, t } from "@lingui/core/macro";
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { sentence } from "../../commands/requests";
import { breakAt } from "../../commands/run";
import { inUserLanguage } from "../../i18n/serverMessages";
import type { CheckScriptData, ScriptProblem } from "../../protocol/types";
import { call } from "../../session/connection";
import { FILE_DEADLINE, rest } from "../../session/rest";
import { whyUnavailable } from "../../store/permissions";
import { anyAction } from "../../store/scope";
import { isClosed } from "../../store/selectors";
import { getState, notify, select, setUi, useEditor } from "../../store/store";
import type { ScriptDraft } from "../../store/ui";
import { nameOf } from "../../viewmodel/names";
import { Button, Waiting } from "../kit/kit";
import { CodeMirror, type Marks } from "./codeMirror";
import { textOfZip } from "./package";
import { Review } from "./Review";
import "./code.css";

/** Delay after the last edit of the project before the script is loaded again, ms. */
const SETTLED = 300;

/** The script of the project as the server has generated it. */
interface Loaded {
  script: string;
  revision: number;
  editable: boolean;
}

/** Return the script of the open project; of the saved one while it is closed for a run. */
async function scriptOf(projectId: string, closed: boolean): Promise<Loaded> {
  if (!closed) return call("ProjectScript");
  const failure = t`The program cannot be loaded`;
  const path = `/project/publish?projectId=${encodeURIComponent(projectId)}`;
  const response = await rest(path, { failure, deadline: FILE_DEADLINE });
  const script = await textOfZip(await response.arrayBuffer(), "script.py");
  if (script === undefined) throw new Error(t`The package has no script.`);
  return { script, revision: 0, editable: false };
}

/** Load the script, and again after each edit of the project, unless the user is editing it. */
function useScript(): [Loaded | null, string] {
  const id = useEditor((state) => state.doc?.project?.id ?? "");
  const doc = useEditor((state) => state.doc);
  const closed = useEditor(isClosed);
  const edited = useEditor((state) => state.ui.scriptDraft?.projectId === id);
  const [loaded, setLoaded] = useState<Loaded | null>(null);
  const [problem, setProblem] = useState("");
  const first = useRef(true);
  // An edit of the project changes the script.
  useEffect(() => {
    if (edited) return;
    let ended = false;
    const load = () =>
      scriptOf(id, closed).then(
        (found) => {
          if (ended) return;
          first.current = false;
          setLoaded(found);
          setProblem("");
        },
        (error: unknown) => ended || setProblem(sentence(error)),
      );
    const timer = setTimeout(load, first.current ? 0 : SETTLED);
    return () => {
      ended = true;
      clearTimeout(timer);
    };
  }, [id, doc, closed, edited]);
  return [loaded, problem];
}

/** Return why the user cannot edit the script; an empty string if they can. */
function useWhyReadOnly(loaded: Loaded | null): string {
  const why = useEditor(
    (state) => whyUnavailable(state, "ImportScript") || (isClosed(state) ? t`Stop the program first.` : ""),
  );
  return why || (loaded?.editable ? "" : t`This project has no program to edit.`);
}

export default function CodeView() {
  const id = useEditor((state) => state.doc?.project?.id ?? "");
  const draft = useEditor((state) => (state.ui.scriptDraft?.projectId === id ? state.ui.scriptDraft : undefined));
  const [found, failure] = useScript();
  const loaded: Loaded | null = useMemo(
    () => (draft ? { script: draft.script, revision: draft.revision, editable: true } : found),
    [draft, found],
  );
  const [checked, setChecked] = useState<CheckScriptData | null>(null);
  const [reviewing, setReviewing] = useState(false);
  const whyReadOnly = useWhyReadOnly(loaded);
  const editor = useRef<CodeMirror | null>(null);

  const onEdit = useCallback(
    (text: string) => {
      if (!loaded) return;
      setChecked(null);
      const { script, revision } = loaded;
      if (!getState().ui.scriptDraft) select(null); // room for the text
      setUi({ scriptDraft: text === script ? undefined : { projectId: id, script, revision, text } });
    },
    [id, loaded],
  );
  const check = useCallback(async (): Promise<CheckScriptData | null> => {
    const { scriptDraft } = getState().ui;
    if (!scriptDraft) return null;
    const answer = await call("CheckScript", { script: scriptDraft.text, revision: scriptDraft.revision });
    const result = { ...answer, problems: answer.problems.map(inUserLanguage) };
    if (getState().ui.scriptDraft?.text === scriptDraft.text) setChecked(result);
    return result;
  }, []);

  if (!loaded && !failure) return <Waiting>{t`Loading the program…`}</Waiting>;
  const discard = () => {
    if (draft) editor.current?.load(draft.script);
    setUi({ scriptDraft: undefined });
    setChecked(null);
  };
  const review = () =>
    void check().then(
      (result) => {
        const [problem] = result?.problems ?? [];
        if (problem?.line) editor.current?.show(problem.line);
        else if (problem) notify("error", problem.message);
        else if (result) setReviewing(true);
      },
      (error: unknown) => notify("error", sentence(error)),
    );
  return (
    <section className="code" aria-label={t`Python program`}>
      <div className="code-tools">
        {failure && (
          <p className="code-note" role="alert">
            {t`No program yet: ${failure}`}
          </p>
        )}
        {draft && !reviewing && <State checked={checked} onShow={(line) => editor.current?.show(line)} />}
        {loaded && !reviewing && (
          <Button
            onPress={() => {
              navigator.clipboard?.writeText(draft?.text ?? loaded.script).then(
                () => notify("info", t`Copied.`),
                () => notify("warn", t`The browser blocks copying.`),
              );
            }}
          >
            {t`Copy`}
          </Button>
        )}
        {draft && !reviewing && (
          <>
            <Button onPress={discard}>{t`Discard changes`}</Button>
            <Button variant="primary" why={whyReadOnly} onPress={review}>
              {t`Review and import`}
            </Button>
          </>
        )}
      </div>
      {loaded && (
        <Script
          key={id}
          text={draft?.text ?? loaded.script}
          whyReadOnly={whyReadOnly}
          hidden={reviewing}
          onEdit={onEdit}
          check={check}
          onReady={(made) => (editor.current = made)}
        />
      )}
      {draft && checked && reviewing && (
        <Review draft={draft} changes={checked.changes} onClose={() => setReviewing(false)} onImport={importScript} />
      )}
    </section>
  );
}

/** Import an edited script. Return why it was refused; an empty string on success. */
async function importScript(draft: ScriptDraft): Promise<string> {
  try {
    await call("ImportScript", { script: draft.text, revision: draft.revision });
    setUi({ scriptDraft: undefined });
    notify("info", t`Imported. Undo reverts it in one step.`);
    return "";
  } catch (error) {
    return sentence(error);
  }
}

/** Whether an edited script can be imported. */
function State({ checked, onShow }: { checked: CheckScriptData | null; onShow: (line: number) => void }) {
  if (!checked) return <p className="code-note quiet">{t`The text was edited and is not imported yet.`}</p>;
  const [problem] = checked.problems;
  if (!problem) {
    const count = checked.changes.length;
    return (
      <p className="code-note" role="status">
        {count === 0
          ? t`Nothing to import.`
          : plural(count, { one: "# change to import.", other: "# changes to import." })}
      </p>
    );
  }
  const { line } = problem;
  return (
    <p className="code-note bad" role="alert">
      {line ? <Button onPress={() => onShow(line)}>{t`Line ${line}: ${problem.message}`}</Button> : problem.message}
    </p>
  );
}

interface ScriptProps {
  text: string;
  whyReadOnly: string;
  hidden: boolean;
  onEdit: (text: string) => void;
  check: () => Promise<CheckScriptData | null>;
  onReady: (editor: CodeMirror | null) => void;
}

/** The script in a text editor; selection, running actions and breakpoints are shared with the other views. */
function Script({ text, whyReadOnly, hidden, onEdit, check, onReady }: ScriptProps) {
  const host = useRef<HTMLDivElement>(null);
  const editor = useRef<CodeMirror | null>(null);
  const handlers = useRef({ onEdit, check });
  handlers.current = { onEdit, check };
  const program = useEditor((state) => state.doc);
  const selected = useEditor((state) => state.doc?.actions[state.ui.selection?.id ?? ""]?.name ?? "");
  const running = useEditor((state) => state.program.running);
  const breakpoints = useEditor((state) => state.breakpoints);
  const marks: Marks = useMemo(() => {
    const nameOfAction = (each: string) => (program && anyAction(program, each)?.name) ?? "";
    return {
      selected,
      running: running.map(nameOfAction),
      breakpoints: new Set(Object.keys(breakpoints).map(nameOfAction)),
      nameOf: (each) => {
        const { doc } = getState();
        const document = [doc?.scene, doc?.project].find((one) => one?.id === each);
        return document?.name ?? nameOf(getState(), each);
      },
    };
  }, [program, selected, running, breakpoints]);

  // Later texts are loaded below.
  useEffect(() => {
    if (!host.current) return;
    const made = new CodeMirror(host.current, text, {
      onEdit: (edited) => handlers.current.onEdit(edited),
      onAction: (name) => {
        // While editing, a tap places the cursor; the panel would cover the text.
        const found = getState().ui.scriptDraft ? undefined : actionNamed(name);
        if (found) select({ kind: "action", id: found });
      },
      onBreakpoint: (name) => {
        const found = actionNamed(name);
        const cannot = whyUnavailable(getState(), "SetBreakpoints");
        if (cannot) notify("info", cannot);
        else if (found) void breakAt(found, !(found in getState().breakpoints));
        else notify("info", t`Import the program first: ${name} is new.`);
      },
      check: async () => {
        const result = await handlers.current.check().catch(() => null); // shows no problems while disconnected
        return (result?.problems ?? []).flatMap((each) => diagnosticOf(made, each));
      },
    });
    editor.current = made;
    onReady(made);
    return () => {
      onReady(null);
      made.view.destroy();
    };
  }, []);
  useEffect(() => {
    editor.current?.load(text);
  }, [text]);
  useEffect(() => editor.current?.mark(marks), [marks]);
  useEffect(() => editor.current?.allow(whyReadOnly === ""), [whyReadOnly]);
  const followed = running.length > 0 ? (marks.running.at(-1) ?? "") : selected;
  useEffect(() => editor.current?.showAction(followed), [followed]);
  return <div className="code-text" ref={host} hidden={hidden} />;
}

function actionNamed(name: string): string | undefined {
  const { doc } = getState();
  const bodies = doc ? [doc.program, ...Object.values(doc.functions)] : [];
  return bodies.flatMap(({ actions }) => Object.values(actions)).find((each) => each.name === name)?.id;
}

/** Return a problem at its place in the text; nothing if it concerns the whole script. */
function diagnosticOf({ view }: CodeMirror, { line, column = 1, message }: ScriptProblem): Diagnostic[] {
  const { doc } = view.state;
  if (line === undefined || line > doc.lines) return [];
  const { from, to } = doc.line(line);
  return [{ from: Math.min(from + column - 1, to), to, severity: "error", message }];
}
