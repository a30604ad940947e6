/** The guided tour: one instruction at a time over the view; it continues when the user has followed it. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { getState, setUi, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { stepsOf } from "./steps";
import "./tour.css";

export default function Tour() {
  const at = useEditor((state) => state.ui.tour) ?? 0;
  const steps = useEditor((state) => stepsOf(state.connection.role));
  const [began, setBegan] = useState(getState);
  const done = useEditor((state) => steps[at]?.done?.(state, began) ?? false);
  const step = steps[at];
  const next = () => {
    setBegan(getState());
    setUi({ tour: at + 1 < steps.length ? at + 1 : null });
  };
  useEffect(() => {
    if (done) next();
  }, [done, at]);
  if (!step) return null;
  return (
    <section className="tour" aria-label={t`Guided tour`}>
      <p aria-live="polite">
        <strong>{`${at + 1}/${steps.length}`}</strong> {i18n._(step.text)}
      </p>
      <div className="row">
        <Button variant="plain" onPress={() => setUi({ tour: null })}>
          {t`End tour`}
        </Button>
        <Button onPress={next}>{step.done ? t`Skip step` : t`Next`}</Button>
      </div>
    </section>
  );
}
