/** The recorded history of points. */

import { t } from "@lingui/core/macro";
import { FILE_DEADLINE, rest } from "../session/rest";
import { saveAs } from "./files";

/** A point that the server has recorded; `number` identifies it. */
export interface HistoryPoint {
  number: number;
  object_id: string;
  name: string;
  digital: boolean;
}

/** The values in equal parts of a period; times in ms since 1970. Parts without a known value are left out. */
export interface PointSummary {
  since: number;
  until: number;
  times: number[];
  lowest: number[];
  highest: number[];
  mean: number[];
}

/** Return whether the server records the history. */
export async function isRecording(): Promise<boolean> {
  return ((await (await rest("/api/history")).json()) as { recording: boolean }).recording;
}

/** Return the recorded point with this name; undefined if there is none. Reject with a sentence. */
export async function findPoint(objectId: string, name: string): Promise<HistoryPoint | undefined> {
  const query = new URLSearchParams({ object_id: objectId });
  const found: HistoryPoint[] = await (await rest(`/api/history/points?${query}`)).json();
  return found.find((each) => each.name === name);
}

/** Return the values of a point of the last `span` ms in `buckets` parts. Reject with a sentence. */
export async function loadSummary(point: number, span: number, buckets: number): Promise<PointSummary> {
  return (await rest(`/api/history/summary?${query(point, span)}&buckets=${buckets}`)).json();
}

/** Save the recorded values of the last `span` ms as CSV on this device. Reject with a sentence. */
export async function exportPoint(point: number, span: number, name: string): Promise<void> {
  const failure = t`The history is not available`;
  const path = `/api/history/values/export?${query(point, span)}&limit=100000`;
  const response = await rest(path, { failure, deadline: FILE_DEADLINE });
  saveAs(await response.blob(), `${name}.csv`);
}

function query(point: number, span: number): URLSearchParams {
  const until = Date.now() + 1000;
  return new URLSearchParams({
    point: String(point),
    since: new Date(until - span).toISOString(),
    until: new Date(until).toISOString(),
  });
}
