/** The generated Python program of the saved project, read-only. */

import { t } from "@lingui/core/macro";
import { useCallback, useEffect, useMemo, useState } from "react";
import * as documents from "../../commands/documents";
import { sentence } from "../../commands/requests";
import { FILE_DEADLINE, rest } from "../../session/rest";
import { whyUnavailable } from "../../store/permissions";
import { isClosed } from "../../store/selectors";
import { notify, select, useEditor } from "../../store/store";
import { Button, Waiting } from "../kit/kit";
import { textOfZip } from "./package";
import { pieces } from "./python";
import "./code.css";

type Code = { source: string } | { problem: string };

async function scriptOf(projectId: string): Promise<Code> {
  const failure = t`The program cannot be loaded`;
  const path = `/project/publish?projectId=${encodeURIComponent(projectId)}`;
  const response = await rest(path, { failure, deadline: FILE_DEADLINE });
  const source = await textOfZip(await response.arrayBuffer(), "script.py");
  return source === undefined ? { problem: t`The package has no script.` } : { source };
}

export default function CodeView() {
  const id = useEditor((state) => state.doc?.project?.id ?? "");
  const unsaved = useEditor((state) => state.doc?.unsaved ?? false);
  const actions = useEditor((state) => state.doc?.actions);
  const selected = useEditor((state) => state.doc?.actions[state.ui.selection?.id ?? ""]?.name ?? "");
  const running = useEditor(isClosed);
  const runningNames = useEditor((state) =>
    state.program.running.map((each) => state.doc?.actions[each]?.name ?? "").join("\n"),
  );
  const cannotSave = useEditor(
    (state) => whyUnavailable(state, "SaveProject") || (isClosed(state) ? t`The program is running.` : ""),
  );
  const [code, setCode] = useState<Code | null>(null);
  const load = useCallback(() => {
    let ended = false;
    scriptOf(id).then(
      (found) => ended || setCode(found),
      (error: unknown) => ended || setCode({ problem: sentence(error) }),
    );
    return () => {
      ended = true;
    };
  }, [id]);
  // Load it again after each save.
  useEffect(() => (unsaved ? undefined : load()), [load, unsaved]);
  useEffect(load, [load]);
  const lines = useMemo(() => (code && "source" in code ? pieces(code.source) : []), [code]);
  const byName = useMemo(() => new Map(Object.values(actions ?? {}).map((each) => [each.name, each.id])), [actions]);

  if (!code) return <Waiting>{t`Loading the program…`}</Waiting>;
  const lit = new Set(runningNames.split("\n").filter(Boolean));
  return (
    <section className="code" aria-label={t`Python program`}>
      {unsaved && !running && (
        <p className="code-note">
          {t`This is the last saved program.`}{" "}
          <Button why={cannotSave} onPress={() => void documents.save()}>
            {t`Save and reload`}
          </Button>
        </p>
      )}
      {"problem" in code ? (
        <p className="code-note" role="alert">
          {t`No program yet: ${code.problem}`}
        </p>
      ) : (
        <>
          <div className="code-tools">
            <Button
              onPress={() => {
                navigator.clipboard?.writeText(code.source).then(
                  () => notify("info", t`Copied.`),
                  () => notify("warn", t`The browser blocks copying.`),
                );
              }}
            >
              {t`Copy`}
            </Button>
          </div>
          <pre tabIndex={0}>
            <ol>
              {lines.map((line, index) => {
                const called = line.map((each) => actionIn(each.text, byName)).find(Boolean) ?? "";
                return (
                  <li
                    key={index}
                    data-selected={called !== "" && called === selected}
                    data-running={lit.has(called)}
                    data-action={called || undefined}
                    onClick={() => called && select({ kind: "action", id: byName.get(called) ?? "" })}
                  >
                    {line.map((each, at) => (
                      <span key={at} className={each.kind}>
                        {each.text}
                      </span>
                    ))}
                  </li>
                );
              })}
            </ol>
          </pre>
        </>
      )}
    </section>
  );
}

/** Return the action named in a string: the script passes the names of actions to its calls. */
function actionIn(text: string, byName: Map<string, string>): string {
  const name = text.replace(/^["']|["']$/g, "");
  return name !== text && byName.has(name) ? name : "";
}
