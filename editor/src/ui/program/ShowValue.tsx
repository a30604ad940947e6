/** Preview of a value in the 3D view: the ghost of the robot at a pose or joints. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { chosenRobot, hideGhost, showGhostAt, showGhostJoints } from "../../commands/robot";
import { theEngine } from "../../session/engine";
import { getState, useEditor } from "../../store/store";
import { worldOf } from "../../viewmodel/frames";
import { Button } from "../kit/kit";

interface ShowValueProps {
  robotId: string;
  /** Words of the parameter. */
  label: string;
  /** Id of an orientation or joints. */
  value: string;
}

export function ShowValue({ robotId, label, value }: ShowValueProps) {
  const joints = useEditor((state) => state.doc?.joints[value]);
  const known = useEditor(
    (state) => state.doc !== null && (value in state.doc.joints || value in state.doc.orientations),
  );
  const chosen = useEditor((state) => chosenRobot(state));
  const mine = chosen?.robotId === robotId ? chosen : null;
  const [shown, setShown] = useState(false);
  const [problem, setProblem] = useState("");
  const show = () => {
    const { doc } = getState();
    if (!doc) return;
    setProblem("");
    if (joints) showGhostJoints(robotId, joints.joints);
    else if (mine) void showGhostAt(mine, worldOf(doc, value)).then(setProblem);
    if (theEngine()?.item(robotId)?.visible === false) theEngine()?.focus(robotId);
  };
  // While it is shown, the ghost follows the value.
  useEffect(() => {
    if (!shown) return;
    show();
    return hideGhost;
  }, [shown, value, robotId]);
  if (!known) return null;
  const why = joints || mine?.effector ? "" : t`Go online first. The end effectors are unknown offline.`;
  return (
    <>
      <Button
        variant="plain"
        icon="eye"
        aria-pressed={shown}
        aria-label={t`Show ${label} in the 3D view`}
        why={shown ? "" : why}
        onPress={() => setShown(!shown)}
      />
      {shown && problem && <span className="error small">{problem}</span>}
    </>
  );
}
