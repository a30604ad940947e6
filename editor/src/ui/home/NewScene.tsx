/** Ask for the name and the template of a new scene. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import * as documents from "../../commands/documents";
import { useEditor } from "../../store/store";
import { AskName } from "../kit/lazyControls";
import { StartFrom } from "./StartFrom";

export function NewScene({ onClose }: { onClose: () => void }) {
  const scenes = useEditor((state) => state.lists.scenes) ?? [];
  const [from, setFrom] = useState("");
  const make = (name: string) => void (from ? documents.fromTemplate("scene", from, name) : documents.newScene(name));
  return (
    <AskName
      title={t`New scene`}
      confirmLabel={t`Create`}
      taken={scenes.map((each) => each.name)}
      onConfirm={make}
      onClose={onClose}
    >
      <StartFrom of={scenes} value={from} onChange={setFrom} />
    </AskName>
  );
}
