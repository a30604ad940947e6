/** The menu of a function: parameters, rename, duplicate, export, remove. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import {
  duplicateFunction,
  exportFunction,
  openFunction,
  removeFunction,
  renameFunction,
} from "../../commands/functions";
import { notEditable } from "../../commands/program";
import { callsOf, functionNames } from "../../program/functions";
import { START } from "../../program/steps";
import { scopeOf } from "../../store/scope";
import { getState, select, setUi, useEditor } from "../../store/store";
import { AskName, More } from "../kit/lazyControls";

export function FunctionMenu({ id }: { id: string }) {
  const state = useEditor((each) => each);
  const [renaming, setRenaming] = useState(false);
  const { doc } = state;
  const called = doc?.functions[id];
  if (!doc || !called) return null;
  const { name } = called;
  const why = notEditable(state, "RenameFunction");
  const calls = callsOf(doc, id).map((each) => each.action.name);
  const showParameters = () => {
    const open = getState().doc;
    if (open && scopeOf(open) !== id) openFunction(id);
    setUi({ tool: "" });
    select({ kind: "terminal", id: START });
  };
  return (
    <>
      <More
        label={t`Function ${name}`}
        choices={[
          { id: "parameters", label: t`Parameters`, icon: "settings", act: showParameters },
          { id: "rename", label: t`Rename`, why, act: () => setRenaming(true) },
          {
            id: "duplicate",
            label: t`Duplicate`,
            why: notEditable(state, "ImportFunction"),
            act: () => void duplicateFunction(id),
          },
          { id: "export", label: t`Export to a file`, icon: "save", act: () => void exportFunction(id) },
          {
            id: "remove",
            label: t`Remove`,
            why: why || (calls.length > 0 ? t`Called by ${calls.join(", ")}.` : ""),
            act: () => void removeFunction(id),
          },
        ]}
      />
      {renaming && (
        <AskName
          title={t`Rename the function`}
          initial={name}
          confirmLabel={t`Rename`}
          taken={functionNames(doc)}
          onConfirm={(wanted) => void renameFunction(id, wanted)}
          onClose={() => setRenaming(false)}
        />
      )}
    </>
  );
}
