/** Names the devices that are online but cannot be controlled, with a button that opens the missing setting. */

import { plural, t } from "@lingui/core/macro";
import { goOffline } from "../../commands/operation";
import { words } from "../../program/naming";
import { derivesFrom } from "../../store/selectors";
import { select, setUi, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { uncontrolledOnline } from "./uncontrolled";
import "../run/banner.css";

export default function ControlBanner() {
  const found = useEditor(uncontrolledOnline);
  const devices = useEditor(
    (state) =>
      Object.values(state.doc?.objects ?? {}).filter((each) => !derivesFrom(state, each.type, "VirtualCollisionObject"))
        .length,
  );
  const [first] = found;
  if (!first) return null;
  const setting = first.settings.map(words).join(", ");
  const show = () => {
    setUi({ tool: "" });
    select({ kind: "object", id: first.id });
  };
  return (
    <div className="result-banner control-banner warn" role="status">
      <Icon name="warn" />
      <p>
        <strong>
          {plural(found.length, {
            one: `Online, # of ${devices} devices can’t be controlled`,
            other: `Online, # of ${devices} devices can’t be controlled`,
          })}
        </strong>{" "}
        <span className="small">{t`${first.name}: ${setting} is not set.`}</span>
      </p>
      <Button
        onPress={() => {
          show();
          void goOffline();
        }}
      >
        {t`Go offline and set it`}
      </Button>
    </div>
  );
}
