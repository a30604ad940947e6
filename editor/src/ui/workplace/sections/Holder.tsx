/** Who else holds the selected thing, since when, and what can be done about it. */

import { useEffect, useState } from "react";
import { askFor, noLongerAsk } from "../../../commands/handover";
import { hasAsked } from "../../../store/handover";
import { heldBy } from "../../../store/selectors";
import { useEditor } from "../../../store/store";
import { Icon } from "../../kit/icons";
import { Button } from "../../kit/kit";
import { ago } from "../../times";

export default function Holder({ id }: { id: string }) {
  const holder = useEditor((state) => heldBy(state, id));
  const since = useEditor((state) => state.lockedAt[id] ?? 0);
  const here = useEditor((state) => state.users[holder]?.online === true);
  const asked = useEditor((state) => hasAsked(state, id));
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 20_000);
    return () => clearInterval(timer);
  }, []);
  if (!holder) return null;
  const how = here ? `It is free when ${holder} is done with it, or some minutes after ${holder}'s connection is lost.` : `${holder} is not connected: it becomes free by itself within some minutes.`;
  return (
    <div className="holder" role="status">
      <p className="tag warn">
        <Icon name="lock" size={16} /> {holder} works on it
      </p>
      <p className="quiet small">
        {since > 0 && `Since ${new Date(since).toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" })}, ${ago(new Date(since).toISOString())}. `}
        {how}
      </p>
      {here &&
        (asked ? (
          <p className="small">
            {holder} is asked for it, and you are told when it is free. <Button onPress={() => noLongerAsk(id)}>No more</Button>
          </p>
        ) : (
          <Button icon="people" onPress={() => askFor(id)}>
            Ask {holder} for it
          </Button>
        ))}
    </div>
  );
}
