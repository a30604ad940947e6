/** Times as text. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";

const STEPS: [number, Intl.RelativeTimeFormatUnit][] = [
  [60, "second"],
  [3600, "minute"],
  [86_400, "hour"],
  [7 * 86_400, "day"],
];

/** Redraw the component every 20 s, so that its relative times stay correct. */
export function useTicking(): void {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 20_000);
    return () => clearInterval(timer);
  }, []);
}

/** Return the time of day, "12:31", or with seconds "12:31:07". `time` is RFC 3339 or in ms since 1970. */
export function clock(time: string | number, seconds = false): string {
  return new Date(time).toLocaleTimeString(i18n.locale, {
    hour: "2-digit",
    minute: "2-digit",
    ...(seconds && { second: "2-digit" }),
    hourCycle: "h23",
  });
}

/** Return "5 minutes ago", or the date if it is longer than a week ago. `time` is RFC 3339. */
export function ago(time: string, present = Date.now()): string {
  const seconds = Math.round((Date.parse(time) - present) / 1000);
  if (Math.abs(seconds) < 10) return t`just now`;
  let before = 1;
  for (const [limit, unit] of STEPS) {
    if (Math.abs(seconds) < limit)
      return new Intl.RelativeTimeFormat(i18n.locale, { numeric: "auto" }).format(Math.round(seconds / before), unit);
    before = limit === 60 ? 60 : limit === 3600 ? 3600 : 86_400;
  }
  return new Date(time).toLocaleDateString(i18n.locale, { day: "numeric", month: "short", year: "numeric" });
}
