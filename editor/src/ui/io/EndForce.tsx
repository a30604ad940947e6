/** The button that ends a force. Another person is asked to confirm it. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { endForce, isOwn } from "../../commands/forces";
import type { ForcedPoint } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";

export function EndForce({ force }: { force: ForcedPoint }) {
  const [asking, setAsking] = useState(false);
  const why = useEditor((state) => whyUnavailable(state, "EndForce"));
  const { user } = force;
  const output = `${force.object}: ${force.point}`;
  const end = () => void endForce(force.id);
  return (
    <>
      <Button why={why} aria-label={t`End force: ${output}`} onPress={() => (isOwn(force) ? end() : setAsking(true))}>
        {t`End force`}
      </Button>
      {asking && (
        <Confirm
          title={t`End the force of ${output}?`}
          confirmLabel={t`End force`}
          onClose={() => setAsking(false)}
          onConfirm={end}
        >
          <p>{t`${user} forces it. It returns to its previous value, and connected devices may move.`}</p>
        </Confirm>
      )}
    </>
  );
}
