/** In the corner of the view: the active robot, and a button that adds a point at its pose. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { addPointFromRobot, teachPoint } from "../../commands/points";
import { refusal } from "../../commands/requests";
import { chosenRobot, notReady } from "../../commands/robot";
import { isRunning } from "../../store/selectors";
import { notify, setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import "./chip.css";

export default function RobotChip() {
  const chosen = useEditor(chosenRobot);
  const name = useEditor((state) => (chosen ? nameOf(state, chosen.robotId) : ""));
  const open = useEditor((state) => state.ui.tool === "robot");
  const project = useEditor((state) => state.doc?.project != null);
  const running = useEditor(isRunning);
  const why = useEditor((state) => notReady(state, chosen, "AddApUsingRobot"));
  const online = useEditor((state) => state.live.state === "started");
  const moving = useEditor((state) => chosen !== null && chosen.robotId in state.live.moving);
  const [asking, setAsking] = useState(false);
  if (!chosen || running) return null;
  const words = [name, chosen.armId, chosen.effector].filter(Boolean).join(" · ");
  const savePoint = () => {
    if (why) {
      notify("info", why);
      return;
    }
    setAsking(true);
    // While the user is jogging, the panel stays open for the next point.
    const work = open
      ? refusal(async () => notify("info", t`Saved ${await teachPoint(chosen)}.`))
      : addPointFromRobot(chosen);
    void work.then((refused) => {
      setAsking(false);
      if (refused) notify("error", refused);
      else if (!open) setUi({ tool: "" });
    });
  };
  return (
    <div className="robot-chip">
      <button
        type="button"
        className="button"
        aria-pressed={open}
        aria-label={t`Active robot: ${words}`}
        onClick={() => setUi({ tool: open ? "" : "robot" })}
      >
        <Icon name="robot" />
        <span className="chip-words">{words}</span>
        {moving && <span className="tag warn">{t`moving`}</span>}
      </button>
      {online && project && (
        <button
          type="button"
          className="button primary"
          aria-disabled={why !== "" || asking || undefined}
          aria-label={t`Save the robot pose as a point`}
          onClick={savePoint}
          disabled={asking}
        >
          <Icon name="plus" />
          {t`Point`}
        </button>
      )}
    </div>
  );
}
