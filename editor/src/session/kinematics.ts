/** Which kinematics of a robot are in force (docs/protocol.md). */

import { remembered } from "./memory";

export interface RobotKinematics {
  object_id: string;
  in_force: "none" | "nominal" | "measured";
  read?: string;
  refused?: string;
}

/** Ask for those of a robot of the open scene; rejects when there is no answer. */
export async function readKinematics(robotId: string, signal: AbortSignal): Promise<RobotKinematics> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/api/robots/${encodeURIComponent(robotId)}/kinematics`, { headers, signal });
  if (!response.ok) throw new Error(`no kinematics of ${robotId} (${response.status})`);
  return (await response.json()) as RobotKinematics;
}
