/** Times in words. */

import { useEffect, useState } from "react";

const STEPS: [number, Intl.RelativeTimeFormatUnit][] = [
  [60, "second"],
  [3600, "minute"],
  [86_400, "hour"],
  [7 * 86_400, "day"],
];
const format = new Intl.RelativeTimeFormat("en", { numeric: "auto" });

/** Redraw the component every 20 s, so that its relative times stay correct. */
export function useTicking(): void {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 20_000);
    return () => clearInterval(timer);
  }, []);
}

/** "5 minutes ago", or the date when that is longer than a week ago. `time` is RFC 3339. */
export function ago(time: string, present = Date.now()): string {
  const seconds = Math.round((Date.parse(time) - present) / 1000);
  if (Math.abs(seconds) < 10) return "just now";
  let before = 1;
  for (const [limit, unit] of STEPS) {
    if (Math.abs(seconds) < limit) return format.format(Math.round(seconds / before), unit);
    before = limit === 60 ? 60 : limit === 3600 ? 3600 : 86_400;
  }
  return new Date(time).toLocaleDateString("en", { day: "numeric", month: "short", year: "numeric" });
}
