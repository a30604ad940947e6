/** Problems of a scene or project that prevent opening it, and their repair. */

import { plural, t } from "@lingui/core/macro";
import { useState } from "react";
import * as documents from "../../commands/documents";
import { faultyObjects, removeObjects } from "../../commands/repair";
import { sentence } from "../../commands/requests";
import type { Entry } from "../../home/entries";
import { whyUnavailable } from "../../store/permissions";
import { notify, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";

interface ProblemsProps {
  entry: Entry;
  whyOpen: string;
  /** Show the scene of a project in the list of scenes. */
  onScene: () => void;
}

export function Problems({ entry: { kind, id, name, problems, explanations, from }, whyOpen, onScene }: ProblemsProps) {
  const [faulty, setFaulty] = useState<string[] | null>(null);
  const noScene = useEditor((state) => whyUnavailable(state, "SaveScene"));
  const ofScene = useEditor((state) => state.lists.scenes?.find((each) => each.id === from?.id)?.problems?.length ?? 0);
  return (
    <details className="problems">
      <summary>
        <span className="tag bad">
          <Icon name="warn" size={16} /> {plural(problems.length, { one: "# problem", other: "# problems" })}
        </span>
      </summary>
      <ul>
        {explanations.map((each) => (
          <li key={each}>{each}</li>
        ))}
      </ul>
      {kind === "project" &&
        from &&
        !from.gone &&
        (ofScene ? (
          <Button aria-label={t`Show the scene of ${name}`} onPress={onScene}>
            {t`Show the scene`}
          </Button>
        ) : (
          <Button
            why={whyOpen}
            aria-label={t`Open the scene of ${name}`}
            onPress={() => void documents.openScene(from.id)}
          >
            {t`Open the scene`}
          </Button>
        ))}
      {kind === "scene" && (
        <Button
          why={noScene}
          aria-label={t`Repair ${name}`}
          onPress={() => void faultyObjects(id, problems).then(setFaulty, (error) => notify("error", sentence(error)))}
        >
          {t`Repair`}
        </Button>
      )}
      {faulty && (
        <Confirm
          title={t`Repair ${name}?`}
          confirmLabel={t`Remove objects`}
          why={faulty.length > 0 ? "" : t`No single object causes the problem. Import the scene again.`}
          onClose={() => setFaulty(null)}
          onConfirm={() =>
            void removeObjects(id, name, faulty).then((wrong) =>
              wrong ? notify("error", wrong) : notify("info", t`${name} can be opened again.`),
            )
          }
        >
          <p>
            {faulty.length > 0
              ? t`These objects are removed from the scene: ${faulty.join(", ")}. A backup of the scene is kept.`
              : t`The problems name no object.`}
          </p>
          <p className="quiet small">{t`If a device type is missing, install its driver.`}</p>
        </Confirm>
      )}
    </details>
  );
}
