/** The group “Functions” of the list of actions: open a function, add an empty one, import one from a file. */

import { t } from "@lingui/core/macro";
import { Suspense, useRef, useState } from "react";
import {
  addFunction,
  type FunctionFile,
  freeFunctionName,
  importFunction,
  openFunction,
  readFunction,
} from "../../commands/functions";
import { notEditable } from "../../commands/program";
import type { Slot } from "../../program/chain";
import { functionNames } from "../../program/functions";
import { notify, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import "./functions.css";
import { AskName } from "../kit/lazyControls";

const ParallelDialog = lazyComponent(() => import("./ParallelDialog"));
const ImportDialog = lazyComponent(() => import("./ImportDialog"));

export function OpenButton({ id, name }: { id: string; name: string }) {
  return <Button variant="plain" icon="function" aria-label={t`Open ${name}`} onPress={() => openFunction(id)} />;
}

/** `slot`: where parallel work is added. */
export function NewFunction({ slot }: { slot: Slot | null }) {
  const doc = useEditor((state) => state.doc);
  const why = useEditor((state) => notEditable(state, "AddFunction"));
  const input = useRef<HTMLInputElement>(null);
  const [naming, setNaming] = useState(false);
  const [choosing, setChoosing] = useState(false);
  const [file, setFile] = useState<FunctionFile | null>(null);
  const take = async (chosen: File | undefined) => {
    if (!chosen) return;
    try {
      const found = await readFunction(chosen);
      if (found.points.length > 0) return setFile(found);
      const refused = await importFunction(found, {});
      if (refused) notify("error", refused);
    } catch (error) {
      notify("error", error instanceof Error ? error.message : String(error));
    }
  };
  return (
    <div className="row">
      <Button icon="plus" why={why} onPress={() => setNaming(true)}>
        {t`New function`}
      </Button>
      {Object.keys(doc?.functions ?? {}).length > 1 && (
        <Button icon="parallel" why={why} onPress={() => setChoosing(true)}>
          {t`Run in parallel`}
        </Button>
      )}
      <Button variant="plain" why={why} onPress={() => input.current?.click()}>
        {t`Import a function`}
      </Button>
      <input
        ref={input}
        type="file"
        accept=".json"
        className="hidden-but-read"
        tabIndex={-1}
        aria-hidden="true"
        onChange={(event) => {
          void take(event.target.files?.[0]);
          event.target.value = ""; // the same file can be selected again
        }}
      />
      {naming && doc && (
        <AskName
          title={t`New function`}
          initial={freeFunctionName("function_1")}
          confirmLabel={t`Add`}
          taken={functionNames(doc)}
          onConfirm={(name) => void addFunction(name)}
          onClose={() => setNaming(false)}
        />
      )}
      {choosing && (
        <Suspense fallback={null}>
          <ParallelDialog slot={slot} onClose={() => setChoosing(false)} />
        </Suspense>
      )}
      {file && (
        <Suspense fallback={null}>
          <ImportDialog file={file} onClose={() => setFile(null)} />
        </Suspense>
      )}
    </div>
  );
}
