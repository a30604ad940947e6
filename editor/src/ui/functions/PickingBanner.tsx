/** The actions that are being selected for a function, and why they cannot become one. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { cancelPicking, makeFunction, whyNoFunction } from "../../commands/functions";
import { functionNames, suggestedName } from "../../program/functions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { AskName } from "../kit/lazyControls";
import "./functions.css";

export default function PickingBanner() {
  const picked = useEditor((state) => state.ui.picked);
  const doc = useEditor((state) => state.doc);
  const [why, setWhy] = useState("");
  const [asking, setAsking] = useState(false);
  const ids = picked?.filter((id) => doc && id in doc.actions) ?? [];
  const key = ids.join();
  useEffect(() => {
    let ended = false;
    void whyNoFunction(ids).then((found) => ended || setWhy(found));
    return () => {
      ended = true;
    };
  }, [key, doc?.actions, doc?.logic]);
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => event.key === "Escape" && !asking && cancelPicking();
    window.addEventListener("keydown", onKey);
    return () => window.removeEventListener("keydown", onKey);
  }, [asking]);
  if (!picked || !doc) return null;
  return (
    <div className="banner picking" role="group" aria-label={t`Make a function`}>
      <p role="status">
        {ids.length === 0 ? (
          t`Tap the first and the last action of the function.`
        ) : (
          <strong>{plural(ids.length, { one: "# action selected", other: "# actions selected" })}</strong>
        )}
        {ids.length > 0 && why && <span className="small"> {why}</span>}
      </p>
      <Button look="primary" icon="function" why={why} onPress={() => setAsking(true)}>
        {t`Make a function`}
      </Button>
      <Button look="plain" onPress={cancelPicking}>{t`Cancel`}</Button>
      {asking && (
        <AskName
          title={t`Make a function`}
          label={t`Name of the function`}
          initial={suggestedName(doc, ids)}
          yes={t`Make a function`}
          taken={functionNames(doc)}
          onYes={(name) => void makeFunction(name, ids)}
          onClose={() => setAsking(false)}
        />
      )}
    </div>
  );
}
