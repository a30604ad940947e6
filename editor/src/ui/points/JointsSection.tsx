/** Joints of a point: values and limits, update from the robot, recompute after the point moved. */

import { t } from "@lingui/core/macro";
import { removeJoints, renameJoints, setJoints, setJointsToRobot, solveJoints } from "../../commands/points";
import { notReady } from "../../commands/robot";
import { select, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { NumberField } from "../kit/fields";
import { Button } from "../kit/kit";
import { More } from "../kit/lazyControls";
import { Limits, shownJoints } from "../robot/JointsTab";
import type { Section } from "../workplace/section";
import { useWhyNot } from "./editing";
import { NameField } from "./NameField";
import { ReachAnswers } from "./Reach";
import { RefusedText, useRefusal } from "./Refusal";
import { Remove } from "./Remove";
import "./points.css";
import "../robot/robot.css";

const JointsSection: Section["Body"] = ({ selection: { id } }) => {
  const stored = useEditor((state) => state.doc?.joints[id]);
  const all = useEditor((state) => state.doc?.orientations);
  const point = useEditor((state) => (stored ? nameOf(state, stored.pointId) : ""));
  const robot = useEditor((state) => (stored ? nameOf(state, stored.robot_id) : ""));
  const why = useWhyNot(stored?.pointId ?? "", "UpdateActionPointJoints");
  const noRobot = useEditor((state) =>
    notReady(
      state,
      stored ? { robotId: stored.robot_id, armId: stored.arm_id ?? "", effector: "" } : null,
      "UpdateActionPointJointsUsingRobot",
    ),
  );
  const { refused, busy, ask } = useRefusal();
  if (!stored) return null;
  const orientations = Object.values(all ?? {}).filter((each) => each.pointId === stored.pointId);
  const [only] = orientations;
  const shown = shownJoints(stored.robot_id, stored.joints);
  return (
    <>
      <NameField
        key={id}
        label={t`Joints name`}
        name={stored.name}
        why={why}
        onRename={(name) => renameJoints(id, name)}
      />
      <Button variant="plain" icon="point" onPress={() => select({ kind: "point", id: stored.pointId })}>
        {t`${robot} at ${point}`}
      </Button>
      {!stored.is_valid && <p className="tag warn">{t`The point has moved. These joints no longer reach it.`}</p>}
      <ul className="joints">
        {shown.map((joint) => (
          <li key={joint.name} className="kept">
            <div className="joint-head">
              <span>{joint.name.replaceAll("_", " ")}</span>
              <Limits joint={joint} />
            </div>
            <NumberField
              label={joint.name.replaceAll("_", " ")}
              unit={joint.unit}
              value={joint.value * joint.scale}
              least={joint.lower * joint.scale}
              most={joint.upper * joint.scale}
              isDisabled={why !== "" || busy}
              onChange={(next) =>
                void ask(
                  setJoints(
                    id,
                    stored.joints.map((each) =>
                      each.name === joint.name ? { ...each, value: next / joint.scale } : each,
                    ),
                  ),
                )
              }
            />
          </li>
        ))}
      </ul>
      <div className="actions start">
        <Button icon="robot" why={why || noRobot} isDisabled={busy} onPress={() => void ask(setJointsToRobot(id))}>
          {t`Update from robot`}
        </Button>
        {orientations.length > 1 ? (
          <More
            label={t`Recompute`}
            variant=""
            icon="redo"
            choices={orientations.map((each) => ({
              id: each.id,
              label: t`for ${each.name}`,
              why: why,
              act: () => void ask(solveJoints(id, each.id)),
            }))}
          >
            {t`Recompute`}
          </More>
        ) : (
          <Button
            icon="redo"
            why={why || (only ? "" : t`The point has no orientation.`)}
            isDisabled={busy}
            onPress={() => only && void ask(solveJoints(id, only.id))}
          >
            {t`Recompute`}
          </Button>
        )}
      </div>
      <RefusedText>{refused}</RefusedText>
      <ReachAnswers id={id} />
      <Remove key={`remove ${id}`} name={stored.name} why={why} along="" onRemove={() => removeJoints(id)} />
    </>
  );
};

export default JointsSection;
