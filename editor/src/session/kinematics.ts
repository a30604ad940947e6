/** Kinematics used for a robot (docs/protocol.md). */

import { rest } from "./rest";

export interface RobotKinematics {
  object_id: string;
  in_force: "none" | "nominal" | "measured";
  read?: string;
  refused?: string;
}

/** Request the kinematics of a robot of the open scene; reject without an answer. */
export async function readKinematics(robotId: string): Promise<RobotKinematics> {
  const response = await rest(`/api/robots/${encodeURIComponent(robotId)}/kinematics`);
  return (await response.json()) as RobotKinematics;
}
