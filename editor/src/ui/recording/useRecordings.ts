/** Which recordings the server has, followed while a component shows them. */

import { useEffect, useState } from "react";
import { loadRecordings } from "../../commands/recordings";
import type { RecordingChangedData, RecordingInfo } from "../../protocol/types";
import { getState, useEditor } from "../../store/store";

/** Call `take` with each stored recording while the component is shown. */
export function useRecordingChanges(take: (changed: RecordingChangedData) => void): void {
  useEffect(() => {
    const { runtime } = getState();
    runtime.takeRecording ??= new Set();
    const listeners = runtime.takeRecording;
    listeners.add(take);
    return () => void listeners.delete(take);
  }, [take]);
}

/** Return recordings with a changed one and without deleted ones, newest first. */
function withRecording(known: readonly RecordingInfo[], { recording, deleted }: RecordingChangedData): RecordingInfo[] {
  const others = known.filter(({ number }) => number !== recording.number && !deleted.includes(number));
  return [...others, recording].sort((a, b) => b.number - a.number);
}

/** Return all recordings, newest first; none until they are loaded. */
export function useRecordings(): RecordingInfo[] {
  const ready = useEditor((state) => state.connection.status === "ready");
  const [recordings, setRecordings] = useState<RecordingInfo[]>([]);
  const [take] = useState(
    () => (changed: RecordingChangedData) => setRecordings((known) => withRecording(known, changed)),
  );
  useRecordingChanges(take);
  useEffect(() => {
    if (!ready) return;
    let current = true;
    // An older server has none. Offline they are loaded again after the reconnect.
    loadRecordings().then(
      (found) => current && setRecordings(found),
      () => {},
    );
    return () => {
      current = false;
    };
  }, [ready]);
  return recordings;
}
