/** Confirm a deletion; list the projects that prevent it. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import * as documents from "../../commands/documents";
import type { Entry } from "../../home/entries";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";

const DELETE = { scene: documents.deleteScene, project: documents.deleteProject, package: documents.deletePackage };

export function Deleting({ entry: { kind, id, name }, onClose }: { entry: Entry; onClose: () => void }) {
  const [needing, setNeeding] = useState<{ id: string; name: string }[]>([]);
  useEffect(() => {
    if (kind === "scene") documents.projectsOf(id).then(setNeeding, () => {});
  }, [kind, id]);
  return (
    <Confirm
      title={t`Delete ${name}?`}
      confirmLabel={t`Delete`}
      why={needing.length > 0 ? t`Delete its projects first.` : ""}
      onClose={onClose}
      onConfirm={() => void DELETE[kind](id)}
    >
      {needing.length > 0 ? (
        <>
          <p>{t`Delete the projects of this scene first:`}</p>
          <ul className="needing">
            {needing.map((each) => (
              <li key={each.id}>
                <span>{each.name}</span>
                <Button
                  aria-label={t`Open ${each.name}`}
                  onPress={() => {
                    onClose();
                    void documents.openProject(each.id);
                  }}
                >
                  {t`Open`}
                </Button>
              </li>
            ))}
          </ul>
        </>
      ) : (
        <p>{kind === "package" ? t`The project is not deleted.` : t`This cannot be undone.`}</p>
      )}
    </Confirm>
  );
}
