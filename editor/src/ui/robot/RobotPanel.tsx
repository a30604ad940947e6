/** The active robot: its state, and the ways to move it. */

import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { chosenRobot, notReady } from "../../commands/robot";
import { translated } from "../../i18n/choices";
import { useEditor } from "../../store/store";
import { OneOf } from "../kit/fields";
import { nameOf } from "../names";
import { GoTab } from "./GoTab";
import { HandTab } from "./HandTab";
import { JointsTab } from "./JointsTab";
import { Kinematics } from "./Kinematics";
import { MannerFields } from "./MannerFields";
import { PadPlace } from "./PadDock";
import { RobotChooser } from "./RobotChooser";
import { Status } from "./Status";
import { ToolTab } from "./ToolTab";
import "./robot.css";

const WAYS = [
  ["tool", msg`Tool`],
  ["joints", msg`Joints`],
  ["hand", msg`By hand`],
  ["go", msg`Go to`],
] as const;

/** The way that was selected last, while the page is open. */
let last: (typeof WAYS)[number][0] = "tool";

export default function RobotPanel() {
  const chosen = useEditor(chosenRobot);
  const name = useEditor((state) => (chosen ? nameOf(state, chosen.robotId) : ""));
  const why = useEditor((state) => notReady(state, chosen));
  const [way, setWay] = useState(last);
  const [place, setPlace] = useState<HTMLElement | null>(null);
  if (!chosen) return <p className="quiet">{t`The scene has no robot.`}</p>;
  return (
    <PadPlace value={place}>
      <div className="robot-scroll">
        <div className="robot-head">
          <h3>
            {name}
            {chosen.effector && <span className="quiet"> · {chosen.effector}</span>}
          </h3>
          {why && <p className="quiet small">{why}</p>}
        </div>
        <RobotChooser />
        {!why && <Status chosen={chosen} />}
        <OneOf
          label={t`Control`}
          quiet
          value={way}
          choices={translated(WAYS)}
          onChange={(next) => {
            last = next;
            setWay(next);
          }}
        />
        {way === "tool" && <ToolTab chosen={chosen} />}
        {way === "joints" && <JointsTab chosen={chosen} />}
        {way === "hand" && <HandTab chosen={chosen} />}
        {way === "go" && <GoTab chosen={chosen} key={`${chosen.robotId}/${chosen.armId}/${chosen.effector}`} />}
        {way !== "hand" && <MannerFields />}
        <Kinematics robotId={chosen.robotId} />
      </div>
      <div className="pad-dock" ref={setPlace} />
    </PadPlace>
  );
}
