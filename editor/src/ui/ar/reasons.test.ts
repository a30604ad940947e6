import { afterAll, expect, test, vi } from "vitest";
import { reasonOf } from "./reasons";

vi.stubGlobal("location", { host: "cell.local:6789" });
afterAll(() => {
  vi.unstubAllGlobals();
});

test.each([
  ["insecure", "Browsers allow the camera only on pages", "Open http://cell.local:6789/, install the certificate"],
  [
    "browser",
    "This browser has no access to a camera.",
    "Update it, or use a current Safari, Chrome, Edge or Firefox.",
  ],
  ["markers", "No markers are configured.", "arcor2-hw calibrate online markers"],
  ["dictionary", "markers of this workplace (6x6_50)", "Print markers of 4x4_50."],
  ["refused", "The camera was not allowed.", "Allow it for this page in the settings of the browser, then try again."],
  ["missing", "This device has no camera.", ""],
  ["busy", "Another app uses the camera.", "Close it, then try again."],
  [
    "session",
    "The browser did not start AR.",
    "Install or update Google Play Services for AR, or use the camera only.",
  ],
  ["overlay", "This browser does not show the controls over AR.", "Use the camera only."],
  ["ended", "The camera has stopped.", "Start AR again."],
] as const)("%s: the reason and the next step", (obstacle, reason, next) => {
  const text = reasonOf(obstacle, "6x6_50");
  expect(text).toContain(reason);
  expect(text.endsWith(next) || text.includes(next)).toBe(true);
});
