/** Connection and health of each device. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../../kit/lazy";
import type { Tool } from "../tool";

export const devices: Tool = {
  id: "devices",
  label: msg`Devices`,
  icon: "plug",
  Panel: lazyComponent(() => import("./DevicesPanel")),
};
