/** One cell on the page: state, program, counts, alarms, and the client in control. */

import { plural, t } from "@lingui/core/macro";
import { memo, useState } from "react";
import type { FleetCard } from "../protocol/types";
import { rest } from "../session/rest";
import { Icon } from "../ui/kit/icons";
import { Button } from "../ui/kit/kit";
import { controlOf, ICONS, type Level, reasonOf, stateText } from "./attention";

export const CellCard = memo(function CellCard({ card, level }: { card: FleetCard; level: Level }) {
  const { name, state, alive } = card;
  const reason = reasonOf(card);
  const control = controlOf(state);
  const alarms = state.urgent + state.high + state.medium + state.low;
  const content = (
    <>
      <h3>
        <Icon name={ICONS[level]} />
        <span className="fleet-name">{name}</span>
      </h3>
      {/* The heading of the group already contains the state. */}
      <p className={level === "running" ? "hidden-but-read" : "fleet-state"}>{stateText(card)}</p>
      {reason && <p className="fleet-reason">{reason}</p>}
      {card.conflict && <p className="fleet-reason small">{state.address || state.identity}</p>}
      {(state.program || state.recipe) && (
        <p className="fleet-program quiet small">
          {state.recipe ? `${state.program} · ${state.recipe}` : state.program}
        </p>
      )}
      <p className="fleet-facts small">
        <span title={t`Good and bad units of the last 8 hours`}>
          <Icon name="check" size={16} />
          <span className="hidden-but-read">{t`Good units:`}</span> {state.good}
          {state.bad + state.rejected > 0 && (
            <span className="fleet-bad">
              {" "}
              <Icon name="close" size={16} />
              <span className="hidden-but-read">{t`Bad units:`}</span> {state.bad + state.rejected}
            </span>
          )}
        </span>
        {alarms > 0 && <span>{plural(alarms, { one: "# alarm", other: "# alarms" })}</span>}
        {alive && control && (
          <span className="fleet-control" title={t`In control`}>
            <Icon name={state.authority === "plc" ? "plug" : "people"} size={16} />
            <span className="hidden-but-read">{t`In control:`}</span> {control}
          </span>
        )}
        {state.waiting > 0 && <span>{plural(state.waiting, { one: "# result waits", other: "# results wait" })}</span>}
      </p>
    </>
  );
  return (
    <li className="fleet-card" data-level={level}>
      {state.address ? <a href={`${state.address}/#/operator`}>{content}</a> : <div>{content}</div>}
      {!alive && <Remove id={card.id} name={name} />}
    </li>
  );
});

/** Remove a cell that does not exist any more from the page. It appears again as soon as it has a signal. */
function Remove({ id, name }: { id: string; name: string }) {
  const [refused, setRefused] = useState("");
  const remove = () =>
    rest(`/api/fleet/cells/${encodeURIComponent(id)}`, { method: "DELETE" }).catch((error: Error) =>
      setRefused(error.message),
    );
  return (
    <>
      <Button
        variant="plain"
        icon="close"
        aria-label={t`Remove ${name} from this page`}
        onPress={() => void remove()}
      />
      {refused && <p role="alert">{refused}</p>}
    </>
  );
}
