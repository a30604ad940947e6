/** The reason why AR cannot start, in words. */

import { t } from "@lingui/core/macro";
import type { Obstacle } from "../../ar/support";

/** Return why AR cannot start, and the next step. */
export function reasonOf(obstacle: Obstacle, dictionary: string): string {
  switch (obstacle) {
    case "insecure":
      return [
        t`Browsers allow the camera only on pages that they trust.`,
        t`Open http://${location.host}/, install the certificate of the server, and open this page with https.`,
      ].join(" ");
    case "browser":
      return t`This browser has no access to a camera. Update it, or use a current Safari, Chrome, Edge or Firefox.`;
    case "markers":
      return [
        t`No markers are configured.`,
        t`A technician sticks printed markers into the workplace and stores their poses with:`,
        "arcor2-hw calibrate online markers",
      ].join(" ");
    case "dictionary":
      return t`AR does not detect the markers of this workplace (${dictionary}). Print markers of 4x4_50.`;
    case "refused":
      return t`The camera was not allowed. Allow it for this page in the settings of the browser, then try again.`;
    case "missing":
      return t`This device has no camera.`;
    case "busy":
      return t`Another app uses the camera. Close it, then try again.`;
    case "session":
      return t`The browser did not start AR. Install or update Google Play Services for AR, or use the camera only.`;
    case "overlay":
      return t`This browser does not show the controls over AR. Use the camera only.`;
    case "ended":
      return t`The camera has stopped. Start AR again.`;
  }
}
