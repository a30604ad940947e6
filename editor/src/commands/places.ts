/** The poses at which the view draws devices without a pose: stored with the scene, not used by programs. */

import type { Pose } from "../protocol/types";
import { call, serves } from "../session/connection";
import { getState, store } from "../store/store";

/** Draw a device at a pose, for all users; null: show it in lists only. */
export function placeDevice(id: string, pose: Pose | null): void {
  const document = getState().doc?.scene.id;
  if (document === undefined) return;
  const key = `place/${id}`;
  store.setState(({ view }) => {
    const { [key]: _, ...rest } = view.scene;
    return { view: { ...view, scene: pose ? { ...rest, [key]: pose } : rest } };
  });
  if (!serves("SetViewState")) return;
  // Lost with the connection: after the reconnect the server sends the old values.
  call("SetViewState", { scope: "shared", document, values: { [key]: pose } }).catch(() => {});
}
