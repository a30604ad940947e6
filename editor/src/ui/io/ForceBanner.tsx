/** Names the forced outputs on every screen, and renews those of this page; a separate chunk. */

import { plural, t } from "@lingui/core/macro";
import { useEffect } from "react";
import { RENEW, renewForces } from "../../commands/forces";
import { useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { openPoints } from "./address";
import { EndForce } from "./EndForce";
import { valueText } from "./points";
import "../run/banner.css";
import "./io.css";

/** Number of forces that are named; more are only counted, so that the banner stays small. */
const NAMED = 2;

export default function ForceBanner() {
  const forces = useEditor((state) => state.forces);
  useEffect(() => {
    const timer = setInterval(renewForces, RENEW);
    return () => clearInterval(timer);
  }, []);
  const more = forces.length - NAMED;
  const page = location.hash.startsWith("#/io");
  return (
    <section className="result-banner control-banner force-banner warn" role="status" aria-label={t`Forced outputs`}>
      <Icon name="warn" />
      <ul>
        {forces.slice(0, NAMED).map((each) => {
          const output = `${each.object}: ${each.point}`;
          const value = valueText(each.value, each.unit);
          const { user } = each;
          return (
            <li key={each.id}>
              <p data-name={output}>
                <strong>{t`Forced: ${output} = ${value}`}</strong> <span className="small">{user}</span>
              </p>
              <EndForce force={each} />
            </li>
          );
        })}
        {more > 0 && (
          <li>
            <p>{plural(more, { one: "and # more output", other: "and # more outputs" })}</p>
            {!page && <Button onPress={openPoints}>{t`Show`}</Button>}
          </li>
        )}
      </ul>
    </section>
  );
}
