/** Icons of device categories. */

import type { IconName } from "../kit/icons";

export const CATEGORY_ICONS: Record<string, IconName> = {
  Robots: "robot",
  Grippers: "robot",
  Cameras: "search",
  Identification: "search",
  Measuring: "settings",
  Machines: "settings",
  "Inputs and outputs": "plug",
  Signals: "warn",
  Axes: "redo",
  Printers: "save",
  Containers: "box",
  Services: "people",
  Program: "list",
};
