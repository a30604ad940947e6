/** Report that the server is disconnected. The view stays visible. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { theClient } from "../../session/connection";
import { getState, notify, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import "./lost.css";

export function LostConnection() {
  const { status, reason } = useEditor((state) => state.connection);
  const unsaved = useEditor((state) => state.doc?.unsaved ?? false);
  useEffect(() => {
    // The document is restored before the status becomes ready.
    if (status === "ready" && getState().doc?.unsaved) notify("info", t`Your unsaved changes are still available.`);
  }, [status]);
  if (status === "ready") return null;
  return (
    <div className="lost" role="alert">
      <Icon name="warn" />
      <p>
        <strong>{status === "joining" ? t`Connected again.` : t`No connection to the server.`}</strong>{" "}
        {status === "joining"
          ? t`Loading changes…`
          : [
              t`The screen shows the last known state.`,
              reason,
              unsaved && t`Unsaved changes are kept on the server.`,
              t`Reconnecting…`,
            ]
              .filter(Boolean)
              .join(" ")}
      </p>
      {status === "lost" && (
        <Button variant="plain" onPress={() => theClient().reconnectNow()}>
          {t`Try now`}
        </Button>
      )}
    </div>
  );
}
