/** Relative times stay correct while they are shown. */

import { useEffect, useState } from "react";

/** Redraw the component every 20 s. */
export function useTicking(): void {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 20_000);
    return () => clearInterval(timer);
  }, []);
}
