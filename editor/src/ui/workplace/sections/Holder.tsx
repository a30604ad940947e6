/** The user who has locked the selected item, since when, and the possible actions. */

import { t } from "@lingui/core/macro";
import { Suspense, useEffect, useState } from "react";
import { requestItem, withdrawRequest } from "../../../commands/handover";
import { ago, clock } from "../../../formats";
import { serves } from "../../../session/connection";
import { hasRequested } from "../../../store/handover";
import { heldBy } from "../../../store/selectors";
import { useEditor } from "../../../store/store";
import { Icon } from "../../kit/icons";
import { Button } from "../../kit/kit";
import { lazyComponent } from "../../kit/lazy";

const TakeOver = lazyComponent(() => import("../../people/TakeOver"));

export default function Holder({ id }: { id: string }) {
  const holder = useEditor((state) => heldBy(state, id));
  const since = useEditor((state) => state.lockedAt[id] ?? 0);
  const here = useEditor((state) => state.users[holder]?.online === true);
  const asked = useEditor((state) => hasRequested(state, id));
  const [, tick] = useState(0);
  const [taking, setTaking] = useState(false);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 20_000);
    return () => clearInterval(timer);
  }, []);
  if (!holder) return null;
  const how = here
    ? t`Available when ${holder} has finished, or a few minutes after ${holder} disconnects.`
    : t`${holder} is disconnected. Available in a few minutes, or when a user takes over.`;
  return (
    <div className="holder" role="status">
      <p className="tag warn">
        <Icon name="lock" size={16} /> {here ? t`In use by ${holder}` : t`Locked by ${holder} (left)`}
      </p>
      <p className="quiet small">
        {since > 0 && `${t`Since ${clock(since)}, ${ago(new Date(since).toISOString())}.`} `}
        {how}
      </p>
      {here &&
        (asked ? (
          <p className="small">
            {t`Request sent to ${holder}. You are notified when it is available.`}{" "}
            <Button onPress={() => withdrawRequest(id)}>{t`Cancel request`}</Button>
          </p>
        ) : (
          <Button icon="people" onPress={() => requestItem(id)}>
            {t`Ask ${holder} for it`}
          </Button>
        ))}
      {!here && serves("TakeOverLocks") && (
        <Button icon="lock" onPress={() => setTaking(true)}>
          {t`Take over…`}
        </Button>
      )}
      {taking && (
        <Suspense fallback={null}>
          <TakeOver user={holder} onClose={() => setTaking(false)} />
        </Suspense>
      )}
    </div>
  );
}
