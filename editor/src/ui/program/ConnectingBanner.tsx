/** Report that the next tap ends a connection, with a button to cancel. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { cancelConnecting } from "../../commands/program";
import { getState, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";

export default function ConnectingBanner() {
  const connecting = useEditor((state) => state.ui.connecting);
  useEffect(() => {
    if (!connecting) return;
    const onKey = (event: KeyboardEvent) => {
      if (event.key === "Escape") cancelConnecting();
    };
    window.addEventListener("keydown", onKey);
    return () => window.removeEventListener("keydown", onKey);
  }, [connecting]);
  if (!connecting) return null;
  return (
    <div className="banner" role="status">
      <span>
        {connecting.error
          ? t`Tap the step that follows if ${nameOf(getState(), connecting.from)} fails.`
          : t`Tap the step that follows ${nameOf(getState(), connecting.from)}.`}
      </span>
      <Button variant="plain" className="wraps" onPress={cancelConnecting}>
        {t`Cancel`}
      </Button>
    </div>
  );
}
