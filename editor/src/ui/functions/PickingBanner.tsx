/** The actions that are being selected, and why they cannot become a function or run at once. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { cancelPicking, makeFunction, whyNoFunction } from "../../commands/functions";
import { makeParallel, parallelName, whyNotParallel } from "../../commands/parallel";
import { functionNames, suggestedName } from "../../program/functions";
import { actionNames } from "../../program/naming";
import { calledBy } from "../../program/operands";
import { theEngine } from "../../session/engine";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { AskName } from "../kit/lazyControls";
import "./functions.css";

export default function PickingBanner() {
  const picked = useEditor((state) => state.ui.picked);
  const doc = useEditor((state) => state.doc);
  const [why, setWhy] = useState("");
  const [notAtOnce, setNotAtOnce] = useState("");
  const [asking, setAsking] = useState<"" | "function" | "parallel">("");
  const ids = picked?.filter((id) => doc && id in doc.actions) ?? [];
  const key = ids.join();
  useEffect(() => {
    let ended = false;
    void whyNoFunction(ids).then((found) => ended || setWhy(found));
    void whyNotParallel(ids).then((found) => ended || setNotAtOnce(found));
    return () => {
      ended = true;
    };
  }, [key, doc?.actions, doc?.logic]);
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => event.key === "Escape" && !asking && cancelPicking();
    window.addEventListener("keydown", onKey);
    return () => window.removeEventListener("keydown", onKey);
  }, [asking]);
  // The labels of the view make room for the banner, whose size has changed.
  useEffect(() => theEngine()?.invalidate());
  if (!picked || !doc) return null;
  const calls = ids.length > 1 && ids.every((id) => calledBy(doc, doc.actions[id]));
  const shown = calls ? notAtOnce : why;
  return (
    <div className="banner picking" role="group" aria-label={t`Make a function`}>
      <p role="status">
        {ids.length === 0 ? (
          t`Tap the first and the last action of the function.`
        ) : (
          <strong>{plural(ids.length, { one: "# action selected", other: "# actions selected" })}</strong>
        )}
        {ids.length > 0 && shown && <span className="small"> {shown}</span>}
      </p>
      {calls && (
        <Button variant="primary" icon="parallel" why={notAtOnce} onPress={() => setAsking("parallel")}>
          {t`Run in parallel`}
        </Button>
      )}
      <Button variant={calls ? "" : "primary"} icon="function" why={why} onPress={() => setAsking("function")}>
        {t`Make a function`}
      </Button>
      <Button variant="plain" onPress={cancelPicking}>{t`Cancel`}</Button>
      {asking === "parallel" && (
        <AskName
          title={t`Run in parallel`}
          initial={parallelName()}
          confirmLabel={t`Run in parallel`}
          taken={actionNames(doc)}
          onConfirm={(name) => void makeParallel(name, ids)}
          onClose={() => setAsking("")}
        />
      )}
      {asking === "function" && (
        <AskName
          title={t`Make a function`}
          label={t`Name of the function`}
          initial={suggestedName(doc, ids)}
          confirmLabel={t`Make a function`}
          taken={functionNames(doc)}
          onConfirm={(name) => void makeFunction(name, ids)}
          onClose={() => setAsking("")}
        />
      )}
    </div>
  );
}
