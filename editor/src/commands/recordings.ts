/** Recordings of alarms and failed runs: points, joints and actions around them. */

import { t } from "@lingui/core/macro";
import type { Message, RecordingInfo } from "../protocol/types";
import { FILE_DEADLINE, rest } from "../session/rest";
import { saveAs } from "./files";

/** The values of a point or joint. Each is valid until the next one; null: unknown. Times in ms after the event. */
export interface Signal {
  kind: "point" | "joint" | "state";
  object_id: string;
  object_name: string;
  name: string;
  unit: string;
  times: number[];
  values: (boolean | number | null)[];
}

/** An action. Times in ms after the event; it has no end if it was running at the end of the recording. */
export interface RecordedAction {
  number: number;
  name: string;
  begin: number;
  end?: number;
  object_id?: string;
  object_name?: string;
  call?: number;
  error?: string;
  error_message?: Message;
  results?: string[];
}

export interface Recording extends RecordingInfo {
  signals: Signal[];
  actions: RecordedAction[];
}

/** Return all stored recordings, newest first. Reject with a sentence. */
export async function loadRecordings(): Promise<RecordingInfo[]> {
  return (await rest("/api/recordings")).json();
}

/** Return a recording. Reject with a sentence. */
export async function loadRecording(number: number): Promise<Recording> {
  return (await rest(`/api/recordings/${number}`)).json();
}

/** Save a recording as CSV on this device. Reject with a sentence. */
export async function exportRecording(number: number): Promise<void> {
  const failure = t`The recording is not available`;
  const response = await rest(`/api/recordings/${number}/export`, { failure, deadline: FILE_DEADLINE });
  saveAs(await response.blob(), `recording-${number}.csv`);
}
