/** Calibrate the pose of a robot with a depth camera. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { calibrateRobot } from "../../commands/calibrate";
import { notReady } from "../../commands/robot";
import { derivesFrom } from "../../store/selectors";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { SelectField, SwitchField } from "../kit/fields";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { Records } from "./Records";

const RobotByCamera: Section["Body"] = ({ selection: { id } }) => {
  const cameras = useEditor((state) =>
    Object.values(state.doc?.objects ?? {})
      .filter((each) => derivesFrom(state, each.type, "Camera"))
      .map((each) => each.id)
      .join("\n"),
  );
  const names = useEditor((state) =>
    cameras
      .split("\n")
      .map((each) => nameOf(state, each))
      .join("\n"),
  ).split("\n");
  const why = useWhyNot(id, "CalibrateRobot");
  const offline = useEditor((state) => notReady(state, { robotId: id, armId: "", effector: "" }, "CalibrateRobot"));
  const ids = cameras ? cameras.split("\n") : [];
  const [wanted, setWanted] = useState("");
  const [moves, setMoves] = useState(false);
  const { refused, busy, ask } = useRefusal();
  const camera = ids.includes(wanted) ? wanted : (ids[0] ?? "");
  return (
    <>
      {ids.length > 1 && (
        <SelectField
          label={t`Camera`}
          value={camera}
          choices={ids.map((each, n) => [each, names[n] ?? ""] as const)}
          onChange={setWanted}
        />
      )}
      <SwitchField isSelected={moves} onChange={setMoves}>
        {t`Move the robot into view`}
      </SwitchField>
      <Button
        icon="robot"
        className="wraps"
        why={why || offline || (camera ? "" : t`The scene has no camera.`)}
        isDisabled={busy}
        onPress={() => void ask(calibrateRobot(id, camera, moves))}
      >
        {camera ? t`Calibrate with ${names[ids.indexOf(camera)] ?? ""}` : t`Calibrate`}
      </Button>
      <RefusedText>{refused}</RefusedText>
      <Records id={id} />
    </>
  );
};

export default RobotByCamera;
