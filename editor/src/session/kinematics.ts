/** Kinematics used for a robot (docs/protocol.md). */

import { remembered } from "./localStorage";

export interface RobotKinematics {
  object_id: string;
  in_force: "none" | "nominal" | "measured";
  read?: string;
  refused?: string;
}

/** Request the kinematics of a robot of the open scene; reject without an answer. */
export async function readKinematics(robotId: string, signal: AbortSignal): Promise<RobotKinematics> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/api/robots/${encodeURIComponent(robotId)}/kinematics`, { headers, signal });
  if (!response.ok) throw new Error(`no kinematics of ${robotId} (${response.status})`);
  return (await response.json()) as RobotKinematics;
}
