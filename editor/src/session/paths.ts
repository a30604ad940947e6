/** Straight paths in the world, checked by the server. */

import { t } from "@lingui/core/macro";
import type { Position } from "../protocol/types";
import { rest } from "./rest";

/** Return the id of the first obstacle on a straight path; null if it is free. Reject with a sentence. */
export async function obstacleOn(from: Position, to: Position): Promise<string | null> {
  const response = await rest("/utils/line-safe", {
    method: "PUT",
    json: { pt1: from, pt2: to },
    failure: t`The path cannot be checked`,
  });
  const { safe, object_id } = (await response.json()) as { safe: boolean; object_id?: string };
  return safe ? null : (object_id ?? "");
}
