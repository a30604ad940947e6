/** The changes by an edited script: the items of the project, and the text. */

import { unifiedMergeView } from "@codemirror/merge";
import { EditorState } from "@codemirror/state";
import { EditorView, lineNumbers } from "@codemirror/view";
import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import type { HistoryItem } from "../../protocol/types";
import type { ScriptDraft } from "../../store/ui";
import { Button } from "../kit/kit";
import { appearance } from "./codeMirror";

const KINDS: Record<string, MessageDescriptor> = {
  action: msg`Action`,
  logic: msg`Step`,
  parameter: msg`Variable`,
  function: msg`Function`,
  action_point: msg`Action point`,
  project: msg`Comments and formatting`,
};
const CHANGES: Record<string, MessageDescriptor> = { add: msg`added`, update: msg`changed`, remove: msg`removed` };

interface ReviewProps {
  draft: ScriptDraft;
  changes: readonly HistoryItem[];
  onClose: () => void;
  onImport: (draft: ScriptDraft) => Promise<string>;
}

export function Review({ draft, changes, onClose, onImport }: ReviewProps) {
  const host = useRef<HTMLDivElement>(null);
  const [refusal, setRefusal] = useState("");
  const [busy, setBusy] = useState(false);
  useEffect(() => {
    if (!host.current) return;
    const view = new EditorView({
      parent: host.current,
      state: EditorState.create({
        doc: draft.text,
        extensions: [
          appearance(),
          lineNumbers(),
          EditorState.readOnly.of(true),
          EditorView.editable.of(false),
          EditorView.contentAttributes.of({ tabindex: "0", "aria-label": t`Changes in the text` }),
          unifiedMergeView({ original: draft.script, mergeControls: false, collapseUnchanged: { margin: 3 } }),
        ],
      }),
    });
    return () => view.destroy();
  }, [draft]);
  const run = () => {
    setBusy(true);
    void onImport(draft).then((why) => {
      setBusy(false);
      setRefusal(why);
      if (!why) onClose();
    });
  };
  return (
    <div className="code-review">
      <div className="code-changes">
        <h2>{t`Changes in the project`}</h2>
        {changes.length === 0 && <p className="quiet">{t`Nothing to import.`}</p>}
        <ul>
          {changes.map(({ kind, id, name, change }) => (
            <li key={`${kind} ${id}`} data-change={change}>
              <span className="quiet small">{KINDS[kind] ? i18n._(KINDS[kind]) : kind}</span>{" "}
              {kind !== "project" && name}{" "}
              <span className={`tag ${change === "remove" ? "bad" : change === "add" ? "good" : ""}`}>
                {CHANGES[change] ? i18n._(CHANGES[change]) : change}
              </span>
            </li>
          ))}
        </ul>
        {refusal && (
          <p className="bad" role="alert">
            {refusal}
          </p>
        )}
        <div className="actions">
          <Button onPress={onClose}>{t`Back`}</Button>
          <Button variant="primary" isDisabled={busy || changes.length === 0} onPress={run}>
            {t`Import`}
          </Button>
        </div>
      </div>
      <div className="code-text" ref={host} />
    </div>
  );
}
