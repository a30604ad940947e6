/** Upload a package from a file. */

import { t } from "@lingui/core/macro";
import { useRef, useState } from "react";
import { uploadPackage } from "../../commands/packages";
import { whyUnavailable } from "../../store/permissions";
import { notify, useEditor } from "../../store/store";
import { Button } from "../kit/kit";

export function UploadPackage() {
  const input = useRef<HTMLInputElement>(null);
  const [busy, setBusy] = useState(false);
  const why = useEditor((state) => whyUnavailable(state, "UploadPackage"));
  const take = async (file: File | undefined) => {
    if (!file) return;
    setBusy(true);
    const wrong = await uploadPackage(file);
    setBusy(false);
    notify(wrong ? "error" : "info", wrong || t`Uploaded ${file.name}.`);
  };
  return (
    <>
      <Button icon="plus" why={why} isDisabled={busy} onPress={() => input.current?.click()}>
        {busy ? t`Uploading…` : t`Upload a package`}
      </Button>
      <input
        ref={input}
        type="file"
        accept=".zip"
        className="hidden-but-read"
        tabIndex={-1}
        aria-hidden="true"
        onChange={(event) => {
          void take(event.target.files?.[0]);
          event.target.value = ""; // the same file can be selected again
        }}
      />
    </>
  );
}
