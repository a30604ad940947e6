/** The scenes that use an object type. An unused uploaded type can be deleted. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { whyNot } from "../../commands/requests";
import { deleteType, scenesUsing } from "../../commands/scene";
import type { ObjectTypeMeta } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";

export function TypeUse({ type, onDeleted }: { type: ObjectTypeMeta; onDeleted: () => void }) {
  const [scenes, setScenes] = useState<string[] | null>(null);
  const [why, setWhy] = useState("…");
  const [sure, setSure] = useState(false);
  const cannot = useEditor((state) => whyUnavailable(state, "DeleteObjectTypes"));
  const { refused, ask } = useRefusal();
  useEffect(() => {
    let here = true;
    void scenesUsing(type.type).then(
      (found) => here && setScenes(found),
      () => here && setScenes([]),
    );
    void whyNot("DeleteObjectTypes", [type.type]).then((found) => here && setWhy(found));
    return () => {
      here = false;
    };
  }, [type.type]);
  if (!scenes) return null;
  // Types of installed drivers cannot be deleted; only uploaded types have a date.
  const installed = type.built_in || type.modified === undefined;
  return (
    <div className="type-use">
      <p className="quiet small">
        {scenes.length > 0 ? t`Used in ${scenes.join(", ")}.` : t`Not used in any saved scene.`}
      </p>
      {!installed && (
        <Button why={cannot || why} onPress={() => setSure(true)}>
          {t`Delete type…`}
        </Button>
      )}
      <RefusedText>{refused}</RefusedText>
      {sure && (
        <Confirm
          title={t`Delete ${type.display_name ?? type.type}?`}
          confirmLabel={t`Delete`}
          onClose={() => setSure(false)}
          onConfirm={() => void ask(deleteType(type.type)).then((done) => done && onDeleted())}
        >
          <p>{t`The type and its code are deleted. No scene uses it. This cannot be undone.`}</p>
        </Confirm>
      )}
    </div>
  );
}
