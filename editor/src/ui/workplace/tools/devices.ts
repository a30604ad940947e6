/** Each device's connection and condition. */

import { lazily } from "../../kit/lazily";
import type { Tool } from "../tools";

export const devices: Tool = {
  id: "devices",
  label: "Devices",
  icon: "plug",
  Panel: lazily(() => import("./DevicesPanel")),
};
