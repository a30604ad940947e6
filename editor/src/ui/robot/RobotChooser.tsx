/** Choice of the active robot, its arm and end effector. */

import { t } from "@lingui/core/macro";
import { armOf, chooseRobot, chosenRobot } from "../../commands/robot";
import { robotsOf } from "../../session/streams";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { SelectField } from "../kit/fields";

export function RobotChooser() {
  const chosen = useEditor(chosenRobot);
  const robots = useEditor((state) => robotsOf(state).join("\n"));
  const names = useEditor((state) =>
    robotsOf(state)
      .map((id) => nameOf(state, id))
      .join("\n"),
  );
  const arms = useEditor((state) => (chosen ? state.live.arms[chosen.robotId] : undefined));
  const arm = useEditor((state) => (chosen ? armOf(state, chosen) : undefined));
  if (!chosen) return null;
  const labels = names.split("\n");
  const ids = robots.split("\n");
  return (
    <div className="robot-chooser">
      {ids.length > 1 && (
        <SelectField
          label={t`Robot`}
          value={chosen.robotId}
          choices={ids.map((id, n) => [id, labels[n] ?? ""])}
          onChange={(robotId) => chooseRobot({ robotId, armId: "", effector: "" })}
        />
      )}
      {arms && arms.length > 1 && (
        <SelectField
          label={t`Arm`}
          value={chosen.armId}
          choices={arms.map(({ id }) => [id, id])}
          onChange={(armId) => chooseRobot({ ...chosen, armId, effector: "" })}
        />
      )}
      {arm && arm.effectors.length > 1 && (
        <SelectField
          label={t`End effector`}
          value={chosen.effector}
          choices={arm.effectors.map((id) => [id, id])}
          onChange={(effector) => chooseRobot({ ...chosen, effector })}
        />
      )}
    </div>
  );
}
