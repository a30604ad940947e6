/** The active robot: its state, and its control. */

import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { chosenRobot, notReady } from "../../commands/robot";
import { translated } from "../../i18n/choices";
import { robotsOf } from "../../session/streams";
import { setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { LeaveZone } from "../interlocks/LeaveZone";
import { ToggleGroup } from "../kit/fields";
import { GoTab } from "./GoTab";
import { HandTab } from "./HandTab";
import { JointsTab } from "./JointsTab";
import { Kinematics } from "./Kinematics";
import { MotionFields } from "./MotionFields";
import { PadPlace } from "./PadDock";
import { RobotChooser } from "./RobotChooser";
import { Status } from "./Status";
import { ToolTab } from "./ToolTab";
import "./robot.css";

const TABS = [
  ["tool", msg`Tool`],
  ["joints", msg`Joints`],
  ["hand", msg`By hand`],
  ["go", msg`Go to`],
] as const;

export default function RobotPanel() {
  const chosen = useEditor(chosenRobot);
  const name = useEditor((state) => (chosen ? nameOf(state, chosen.robotId) : ""));
  const why = useEditor((state) => notReady(state, chosen));
  // With several robots, the choice below names it.
  const several = useEditor((state) => robotsOf(state).length > 1);
  const tab = useEditor((state) => state.ui.robotTab);
  const [place, setPlace] = useState<HTMLElement | null>(null);
  if (!chosen) return <p className="quiet">{t`The scene has no robot.`}</p>;
  return (
    <PadPlace value={place}>
      <div className="robot-scroll">
        <div className="robot-head">
          {!several && (
            <h3>
              {name}
              {chosen.effector && <span className="quiet"> · {chosen.effector}</span>}
            </h3>
          )}
          {why && <p className="quiet small">{why}</p>}
        </div>
        <RobotChooser />
        {!why && <Status chosen={chosen} />}
        {!why && <LeaveZone chosen={chosen} />}
        <ToggleGroup
          label={t`Control`}
          quiet
          value={tab}
          choices={translated(TABS)}
          onChange={(robotTab) => setUi({ robotTab })}
        />
        {tab === "tool" && <ToolTab chosen={chosen} />}
        {tab === "joints" && <JointsTab chosen={chosen} />}
        {tab === "hand" && <HandTab chosen={chosen} />}
        {tab === "go" && <GoTab chosen={chosen} key={`${chosen.robotId}/${chosen.armId}/${chosen.effector}`} />}
        {tab !== "hand" && <MotionFields />}
        <Kinematics robotId={chosen.robotId} />
      </div>
      <div className="pad-dock" ref={setPlace} />
    </PadPlace>
  );
}
