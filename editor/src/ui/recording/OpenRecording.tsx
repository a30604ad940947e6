/** A button that opens the recording of an alarm or a run. */

import { t } from "@lingui/core/macro";
import { Suspense, useState } from "react";
import type { RecordingInfo } from "../../protocol/types";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";

const RecordingView = lazyComponent(() => import("./RecordingView"));

export function OpenRecording({ recording }: { recording: RecordingInfo | undefined }) {
  const [open, setOpen] = useState(false);
  if (!recording) return null;
  return (
    <>
      <Button variant="plain" icon="eye" onPress={() => setOpen(true)}>{t`Recording`}</Button>
      {open && (
        <Suspense fallback={null}>
          <RecordingView number={recording.number} onClose={() => setOpen(false)} />
        </Suspense>
      )}
    </>
  );
}
