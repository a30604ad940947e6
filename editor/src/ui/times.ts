/** Relative times stay correct while they are shown. */

import { useEffect, useState } from "react";

/** Redraw the component every `period` s; 0 for never. */
export function useTicking(period = 20): void {
  const [, tick] = useState(0);
  useEffect(() => {
    if (!period) return;
    const timer = setInterval(() => tick((count) => count + 1), period * 1000);
    return () => clearInterval(timer);
  }, [period]);
}
