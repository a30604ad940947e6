/** Move the robot to an orientation or joints; preview with the ghost first. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { chosenRobot, hideGhost, moveToTaught, notReady, showGhostAt, showGhostJoints } from "../../commands/robot";
import { theEngine } from "../../session/engine";
import { getState, useEditor } from "../../store/store";
import { worldOf } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import { Answer } from "../robot/GoTab";
import { MotionFields } from "../robot/MotionFields";
import { motionOptions, useMotionOptions } from "../robot/motionOptions";
import type { Section } from "../workplace/section";
import { RefusedText, useRefusal } from "./Refusal";
import "../robot/robot.css";

const MoveRobot: Section["Body"] = ({ selection: { kind, id } }) => {
  const chosen = useEditor(chosenRobot);
  const joints = useEditor((state) => state.doc?.joints[id]);
  const orientation = useEditor((state) => state.doc?.orientations[id]);
  // Joints belong to their robot, not to the active one.
  const robotId = joints?.robot_id ?? chosen?.robotId ?? "";
  const name = useEditor((state) => nameOf(state, robotId));
  const cannotAsk = useEditor((state) =>
    state.connection.status === "ready"
      ? chosen?.effector || joints
        ? ""
        : t`Go online first. The end effectors are unknown offline.`
      : t`Not connected to the server.`,
  );
  const why = useEditor((state) => notReady(state, chosen && { ...chosen, robotId }, "MoveToActionPoint"));
  const { speed } = useMotionOptions();
  const [answer, setAnswer] = useState<string | null>(null);
  const { refused, busy, ask } = useRefusal();
  useEffect(() => {
    setAnswer(null);
    return hideGhost;
  }, [id]);
  if (!chosen) return <p className="quiet">{t`The scene has no robot.`}</p>;
  const show = () => {
    const { doc } = getState();
    // Show the ghost only if it is visible.
    if (theEngine()?.item(robotId)?.visible === false) theEngine()?.focus(robotId);
    if (joints) {
      const known = getState().reach;
      const reach = Object.values(known)
        .flatMap((each) => each.items)
        .find((each) => each.id === id);
      const problem = reach?.reason ?? "";
      showGhostJoints(joints.robot_id, joints.joints, problem);
      setAnswer(problem);
    } else if (orientation && doc) void showGhostAt(chosen, worldOf(doc, id)).then(setAnswer);
  };
  return (
    <>
      <div className="actions start">
        <Button why={cannotAsk} onPress={show}>
          {t`Preview ${name}`}
        </Button>
        <Button
          variant="primary"
          why={why}
          isDisabled={busy}
          onPress={() =>
            void ask(
              moveToTaught(
                joints ? { ...chosen, robotId, armId: joints.arm_id ?? "" } : chosen,
                kind === "joints" ? { joints_id: id } : { orientation_id: id },
                motionOptions(),
              ),
            )
          }
        >
          {t`Move there`}
        </Button>
      </div>
      <Answer answer={answer} />
      <RefusedText>{refused}</RefusedText>
      <details className="by-numbers">
        <summary>{t`Speed: ${Math.round(speed * 100)} %`}</summary>
        <MotionFields />
      </details>
    </>
  );
};

export default MoveRobot;
