/** Telemetry for numbers on the screen, at a readable rate. */

import { useEffect, useState } from "react";
import { telemetry } from "../../store/telemetry";

/** Time between two updates, s. */
const PAUSE = 0.1;

/** Return a value of a robot's telemetry; the component is rendered a few times per second. */
export function useTelemetry<T>(robotId: string | undefined, read: () => T): T {
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
  return read();
}
