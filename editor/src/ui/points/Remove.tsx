/** Remove a point, an orientation or joints; list what is removed with it. */

import { t } from "@lingui/core/macro";
import { notify } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "./Refusal";

export function Remove({
  name,
  why,
  along,
  onRemove,
}: {
  name: string;
  why: string;
  along: string;
  onRemove: () => Promise<string>;
}) {
  const { refused, busy, ask } = useRefusal();
  return (
    <div className="remove">
      <Button
        icon="close"
        why={why}
        isDisabled={busy}
        onPress={() =>
          void ask(onRemove()).then(
            (done) =>
              done &&
              notify(
                "info",
                along
                  ? t`Removed ${name} with ${along}. Press Undo to restore.`
                  : t`Removed ${name}. Press Undo to restore.`,
              ),
          )
        }
      >
        {t`Remove ${name}`}
      </Button>
      {along && <p className="quiet small">{t`Also removed: ${along}.`}</p>}
      <RefusedText>{refused}</RefusedText>
    </div>
  );
}
