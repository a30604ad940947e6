/** Kinematics used for a robot (docs/protocol.md). */

import { type ServerMessage, translate } from "../i18n/serverMessages";
import { rest } from "./rest";

export interface RobotKinematics {
  object_id: string;
  in_force: "none" | "nominal" | "measured";
  read?: string;
  /** The reason why the calibration of the controller is not used, in the user's language. */
  refused?: string;
}

/** Request the kinematics of a robot of the open scene; reject without an answer. */
export async function readKinematics(robotId: string): Promise<RobotKinematics> {
  const response = await rest(`/api/robots/${encodeURIComponent(robotId)}/kinematics`);
  const found = (await response.json()) as RobotKinematics & Omit<ServerMessage, "text">;
  return found.refused ? { ...found, refused: translate({ ...found, text: found.refused }) } : found;
}
