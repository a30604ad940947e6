/** The diagnosis file: data of the server and what this page recorded. It is not sent anywhere. */

import { t } from "@lingui/core/macro";
import { version } from "../../package.json";
import { refusedWith } from "../session/assets";
import { remembered } from "../session/localStorage";
import { now } from "../store/store";
import { saveAs } from "./files";
import { refusal } from "./requests";

/** Save the file on this device. Return why it failed, or an empty string. */
export function saveDiagnosis(): Promise<string> {
  return refusal(async () => {
    const token = remembered("token");
    const headers = { "Content-Type": "application/json", ...(token ? { Authorization: `Bearer ${token}` } : {}) };
    const response = await fetch("/api/diagnosis", {
      method: "POST",
      headers,
      body: JSON.stringify({ client: recorded() }),
    });
    if (!response.ok) throw new Error(await refusedWith(response, t`The diagnosis file is not available`));
    saveAs(await response.blob(), `diagnosis-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.zip`);
  });
}

function recorded() {
  const { connection, ui, notices, tasks, live, runtime } = now();
  return {
    editor: version,
    browser: navigator.userAgent,
    screen: `${innerWidth} × ${innerHeight} at ${devicePixelRatio}`,
    address: location.origin + location.hash,
    user: connection.user,
    status: connection.status,
    reason: connection.reason,
    mode: ui.mode,
    tool: ui.tool,
    selection: ui.selection,
    live: live.state,
    notices: notices.map(({ level, text, time }) => ({ level, text, time: new Date(time).toISOString() })),
    tasks: Object.values(tasks),
    seen: runtime.diary,
  };
}
