/** Straight paths in the world, checked by the server. */

import { t } from "@lingui/core/macro";
import type { Position } from "../protocol/types";
import { refusedWith } from "./assets";
import { remembered } from "./localStorage";

/** Return the id of the first obstacle on a straight path; null if it is free. Reject with a sentence. */
export async function metBy(from: Position, to: Position): Promise<string | null> {
  const token = remembered("token");
  const headers: HeadersInit = {
    "Content-Type": "application/json",
    ...(token ? { Authorization: `Bearer ${token}` } : {}),
  };
  const response = await fetch("/utils/line-safe", {
    method: "PUT",
    headers,
    body: JSON.stringify({ pt1: from, pt2: to }),
  });
  if (!response.ok) throw new Error(await refusedWith(response, t`The path cannot be checked`));
  const { safe, object_id } = (await response.json()) as { safe: boolean; object_id?: string };
  return safe ? null : (object_id ?? "");
}
