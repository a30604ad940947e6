/** Numbers, times and the order of names as usual in the user's language. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";

/** Largest number of decimals that Intl accepts; a double has no more significant ones. */
const MAX_DECIMALS = 20;

/** Return a function that creates each formatter once per language and key, since creating one is slow. */
function perLanguage<Key, Formatter>(make: (language: string, key: Key) => Formatter): (key: Key) => Formatter {
  const cache = new Map<string, Formatter>();
  return (key) => {
    const id = `${i18n.locale} ${key}`;
    let found = cache.get(id);
    if (found === undefined) {
      found = make(i18n.locale, key);
      cache.set(id, found);
    }
    return found;
  };
}

const exact = perLanguage(
  (language, digits: number) =>
    new Intl.NumberFormat(language, {
      minimumFractionDigits: digits,
      maximumFractionDigits: digits,
      useGrouping: false,
      signDisplay: "negative",
    }),
);
const short = perLanguage(
  (language, digits: number) =>
    new Intl.NumberFormat(language, { maximumFractionDigits: digits, useGrouping: false, signDisplay: "negative" }),
);
const order = perLanguage((language, _: "names") => new Intl.Collator(language, { numeric: true }));
const relative = perLanguage((language, _: "time") => new Intl.RelativeTimeFormat(language, { numeric: "auto" }));

/** Return a number with this many decimals. */
export function fixed(value: number, digits: number): string {
  return exact(digits).format(value);
}

/** Return a number with at most this many decimals, without trailing zeros. */
export function decimal(value: number, digits = MAX_DECIMALS): string {
  return short(digits).format(value);
}

/** The decimal point of the language. */
export function decimalPoint(): string {
  return decimal(0.5).charAt(1);
}

/** Return a typed text with decimal points and hyphens as in source code. Every language accepts commas and points. */
export function normalised(text: string): string {
  return text.trim().replaceAll(",", ".").replaceAll("−", "-");
}

/** Return a typed number; NaN if it is invalid. */
export function numberFrom(text: string): number {
  const clean = normalised(text);
  return clean === "" ? Number.NaN : Number(clean);
}

/** Compare names as a dictionary does, and numbers in them by value. */
export function byName(one: { name: string }, other: { name: string }): number {
  return compareTexts(one.name, other.name);
}

/** Compare texts as a dictionary does, and numbers in them by value. */
export function compareTexts(one: string, other: string): number {
  return order("names").compare(one, other);
}

/** Units of relative times, each used below its limit, s. */
const STEPS: readonly [number, Intl.RelativeTimeFormatUnit][] = [
  [60, "second"],
  [3600, "minute"],
  [86_400, "hour"],
  [7 * 86_400, "day"],
];

/** Return the time of day, "12:31", or with seconds "12:31:07". `time` is RFC 3339 or in ms since 1970. */
export function clock(time: string | number, seconds = false): string {
  return new Date(time).toLocaleTimeString(i18n.locale, {
    hour: "2-digit",
    minute: "2-digit",
    ...(seconds && { second: "2-digit" }),
    hourCycle: "h23",
  });
}

/** Return a day without its year, "2 Jan". `time` is in ms since 1970. */
export function shortDate(time: number): string {
  return new Date(time).toLocaleDateString(i18n.locale, { day: "numeric", month: "short" });
}

/** Return date and time of day. `time` is RFC 3339. */
export function dateAndTime(time: string): string {
  return new Date(time).toLocaleString(i18n.locale, { dateStyle: "medium", timeStyle: "medium" });
}

/** Return "5 minutes ago", or the date if it is longer than a week ago. `time` is RFC 3339. */
export function ago(time: string, present = Date.now()): string {
  const seconds = Math.round((Date.parse(time) - present) / 1000);
  if (Math.abs(seconds) < 10) return t`just now`;
  let before = 1;
  for (const [limit, unit] of STEPS) {
    if (Math.abs(seconds) < limit) return relative("time").format(Math.round(seconds / before), unit);
    before = limit === 60 ? 60 : limit === 3600 ? 3600 : 86_400;
  }
  return new Date(time).toLocaleDateString(i18n.locale, { day: "numeric", month: "short", year: "numeric" });
}

/** Return a duration in s as text with the symbols of SI units. */
export function duration(seconds: number): string {
  if (seconds < 0.995) return `${decimal(seconds * 1000, 0)} ms`;
  if (seconds < 59.5) return `${fixed(seconds, 1)} s`;
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

/** Return a duration in s as text with hours. */
export function hours(seconds: number): string {
  if (seconds < 3600) return duration(seconds);
  const minutes = Math.round(seconds / 60);
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}
