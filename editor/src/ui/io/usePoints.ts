/** The points of all devices, streamed while the page is open and visible. */

import { useEffect, useRef, useState } from "react";
import { inUserLanguage } from "../../i18n/serverMessages";
import type { SceneObject } from "../../protocol/types";
import { call } from "../../session/connection";
import { isLive } from "../../store/selectors";
import { getState, useEditor } from "../../store/store";
import { RATE, type Reported } from "./points";

/** Time for which reports of devices are collected before they are drawn, ms. */
const DRAWN_AFTER = 200;

/** Return what each device has reported. It is drawn at least once per second, so that old values are shown as old. */
export function usePoints(objects: readonly SceneObject[]): ReadonlyMap<string, Reported> {
  const live = useEditor((state) => isLive(state) && state.connection.status === "ready");
  const ids = objects.map((each) => each.id).join();
  const reported = useRef(new Map<string, Reported>());
  const [, draw] = useState(0);
  useEffect(() => {
    if (!live || !ids) return;
    const { runtime } = getState();
    const streamed = ids.split(",");
    let timer: ReturnType<typeof setTimeout> | undefined;
    runtime.takePoints = (data) => {
      reported.current.set(data.object_id, { ...inUserLanguage(data), at: performance.now() / 1000 });
      timer ??= setTimeout(() => {
        timer = undefined;
        draw((count) => count + 1);
      }, DRAWN_AFTER);
    };
    const send = (on: boolean) => {
      // The request is refused if the scene has gone offline, which also ends the streams.
      for (const object_id of streamed)
        call("StreamPoints", on ? { object_id, rate: RATE } : { object_id, send: false }).catch(() => {});
    };
    const visible = () => send(!document.hidden);
    if (!document.hidden) send(true);
    document.addEventListener("visibilitychange", visible);
    const tick = setInterval(() => draw((count) => count + 1), 1000);
    return () => {
      clearTimeout(timer);
      clearInterval(tick);
      runtime.takePoints = undefined;
      document.removeEventListener("visibilitychange", visible);
      if (!document.hidden) send(false);
    };
  }, [ids, live]);
  return reported.current;
}
