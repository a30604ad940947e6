/** The points of all devices as the page shows them. Pure functions. */

import { t } from "@lingui/core/macro";
import { byName, decimal, duration } from "../../formats";
import { translate } from "../../i18n/serverMessages";
import { words } from "../../program/naming";
import { shownUnit } from "../../program/values";
import type { LivePoint, ObjectPointsData, ObservationMeta, PointQuality, SceneObject } from "../../protocol/types";

/** Rate of the points, Hz. */
export const RATE = 2;
/** Time without an event after which values are stale, s. */
const LATE = 2.5;

/** The report of a device, and the time of its arrival, s. */
export interface Reported extends ObjectPointsData {
  at: number;
}

export interface ShownPoint {
  /** Name as the device reports it. */
  id: string;
  name: string;
  use: LivePoint["use"];
  text: string;
  on: boolean | null;
  quality: PointQuality;
  /** Empty while the value is fresh. */
  age: string;
  unit: string;
  point: LivePoint;
}

export interface ShownDevice {
  id: string;
  name: string;
  points: ShownPoint[];
  /** The reason why the points are not known. */
  reason: string;
}

/** Return the name of a point for users. Names of inputs and outputs are not translated. */
function nameOf({ name, use }: LivePoint): string {
  return use === "signal" ? words(translate({ text: name })) : name;
}

export function valueText(value: LivePoint["value"] | undefined, unit: string): string {
  if (value === undefined || value === null) return t`unknown`;
  if (typeof value === "boolean") return value ? t`on` : t`off`;
  if (typeof value === "string") return value;
  const [shown, factor] = shownUnit("double", { unit });
  const number = value * factor;
  const text = decimal(number, Math.abs(number) < 10 ? 3 : 1);
  return shown ? `${text}\u00a0${shown}` : text;
}

/** Return a point as it is shown `late` s after the report of it. */
function shownPoint(
  point: LivePoint,
  late: number,
  connected: boolean,
  declared: readonly ObservationMeta[],
): ShownPoint {
  const unit = point.unit || (declared.find((each) => each.name === point.name)?.unit ?? "");
  const quality =
    !connected || point.quality === "not_connected"
      ? "not_connected"
      : late > LATE && point.quality !== "bad"
        ? "stale"
        : point.quality;
  const age = (point.age ?? 0) + (late > LATE ? late : 0);
  return {
    id: point.name,
    name: nameOf(point),
    use: point.use,
    text: valueText(point.value, unit),
    on: typeof point.value === "boolean" ? point.value : null,
    quality,
    age: point.age !== undefined && age >= 1 ? duration(Math.floor(age)) : "",
    unit,
    point,
  };
}

/** The search: a device, and words in the names of device and point. */
export interface Filter {
  device: string;
  text: string;
}

/** Return the devices with the points that match a filter, by name. Devices without points are left out. */
export function shownDevices(
  objects: readonly SceneObject[],
  reported: ReadonlyMap<string, Reported>,
  filter: Filter,
  { time, connected }: { time: number; connected: boolean },
  observations: (type: string) => readonly ObservationMeta[],
): ShownDevice[] {
  const wanted = filter.text.toLowerCase().split(/\s+/).filter(Boolean);
  const found: ShownDevice[] = [];
  for (const object of [...objects].sort(byName)) {
    const report = reported.get(object.id);
    if (!report || (filter.device && filter.device !== object.id)) continue;
    const declared = observations(object.type);
    const points = report.points
      .map((point) => shownPoint(point, time - report.at, connected, declared))
      .filter(({ id, name }) => {
        const searched = `${object.name} ${id} ${name}`.toLowerCase();
        return wanted.every((word) => searched.includes(word));
      });
    const reason = report.reason && wanted.length === 0 ? report.reason : "";
    if (points.length > 0 || reason) found.push({ id: object.id, name: object.name, points, reason });
  }
  return found;
}
