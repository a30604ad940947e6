/** The diagnosis file: data of the server and what this page recorded. It is not sent anywhere. */

import { t } from "@lingui/core/macro";
import { version } from "../../package.json";
import { FILE_DEADLINE, rest } from "../session/rest";
import { getState } from "../store/store";
import { saveAs } from "./files";
import { refusal } from "./requests";

/** Save the file on this device. Return why it failed, or an empty string. */
export function saveDiagnosis(): Promise<string> {
  return refusal(async () => {
    const failure = t`The diagnosis file is not available`;
    const given = { method: "POST", json: { client: recorded() }, failure, deadline: FILE_DEADLINE };
    const response = await rest("/api/diagnosis", given);
    saveAs(await response.blob(), `diagnosis-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.zip`);
  });
}

function recorded() {
  const { connection, ui, notices, tasks, live, runtime } = getState();
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
