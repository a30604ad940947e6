/** What robots report, for read-outs: as often as people can read, not as often as it comes. */

import { useEffect, useState } from "react";
import { telemetry } from "../../store/telemetry";

/** s between two looks. */
const PAUSE = 0.1;

/** Look at a robot's reports; the component is drawn again a few times a second while they come. */
export function useTelemetry<T>(robotId: string | undefined, look: () => T): T {
  const [, again] = useState(0);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const stop = telemetry.subscribe((id) => {
      if (id !== robotId || timer !== undefined) return;
      timer = setTimeout(() => {
        timer = undefined;
        again((count) => count + 1);
      }, PAUSE * 1000);
    });
    return () => {
      stop();
      clearTimeout(timer);
    };
  }, [robotId]);
  return look();
}
