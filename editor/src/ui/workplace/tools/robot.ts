/** The active robot. */

import { msg, t } from "@lingui/core/macro";
import { robotsOf } from "../../../session/streams";
import { lazyComponent } from "../../kit/lazy";
import type { Tool } from "../tool";

export const robot: Tool = {
  id: "robot",
  label: msg`Robot`,
  icon: "robot",
  whyUnavailable: (state) => (robotsOf(state).length > 0 ? "" : t`The scene has no robot.`),
  Panel: lazyComponent(() => import("../../robot/RobotPanel")),
};
