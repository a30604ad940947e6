/** Set the pose of an object with the robot: one touch with a straight tool, or three points of its frame. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { frameByAxes, hideAtTool, placeAt, placeByRobot, showAtTool, verdictOf } from "../../commands/calibrate";
import { refusal } from "../../commands/requests";
import { chosenRobot, effectorPose, notReady } from "../../commands/robot";
import { translated } from "../../i18n/choices";
import type { Pivot, Position } from "../../protocol/types";
import { getState, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { SwitchField, ToggleGroup } from "../kit/fields";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText, useRefusal } from "../points/Refusal";
import { RobotChooser } from "../robot/RobotChooser";
import { useTelemetry } from "../robot/useTelemetry";
import "../points/points.css";
import "../robot/robot.css";
import type { Section } from "../workplace/section";

const PIVOTS: readonly (readonly [Pivot, MessageDescriptor])[] = [
  ["top", msg`Top`],
  ["middle", msg`Middle`],
  ["bottom", msg`Bottom`],
];

const PlaceByRobot: Section["Body"] = ({ selection: { id } }) => {
  const chosen = useEditor(chosenRobot);
  const why = useWhyNot(id, "UpdateObjectPoseUsingRobot");
  const noRobot = useEditor((state) => notReady(state, chosen, "UpdateObjectPoseUsingRobot"));
  const [pivot, setPivot] = useState<Pivot>("top");
  const { refused, busy, ask } = useRefusal();
  return (
    <>
      <RobotChooser />
      <ToggleGroup label={t`Touched part`} value={pivot} choices={translated(PIVOTS)} onChange={setPivot} />
      <Preview key={id} id={id} pivot={pivot} why={why || noRobot} />
      <Button
        icon="robot"
        why={why || noRobot}
        isDisabled={busy}
        onPress={() => chosen && void ask(placeByRobot(id, chosen, pivot))}
      >
        {t`Set pose from tool`}
      </Button>
      <RefusedText>{refused}</RefusedText>
      <ThreePoints key={id} id={id} why={why || noRobot} />
    </>
  );
};

export default PlaceByRobot;

/** Preview the object at the tool, and follow the tool. */
function Preview({ id, pivot, why }: { id: string; pivot: Pivot; why: string }) {
  const chosen = useEditor(chosenRobot);
  const [on, setOn] = useState(false);
  const [cannot, setCannot] = useState("");
  const object = useEditor((state) => state.doc?.objects[id]);
  const tool = useTelemetry(chosen?.robotId, () => (chosen ? effectorPose(chosen) : undefined));
  const shown = on && !why;
  useEffect(() => setCannot(shown && tool ? showAtTool(id, tool, pivot) : ""), [shown, tool, id, pivot, object]);
  useEffect(() => (shown ? () => hideAtTool(id) : undefined), [shown, id]);
  return (
    <>
      <SwitchField isSelected={shown} onChange={(to) => (why ? setCannot(why) : setOn(to))}>
        {t`Preview on the tool`}
      </SwitchField>
      <RefusedText>{cannot}</RefusedText>
    </>
  );
}

const STEPS = [msg`Origin`, msg`On the x axis`, msg`In the xy plane`] as const;

function ThreePoints({ id, why }: { id: string; why: string }) {
  const chosen = useEditor(chosenRobot);
  const [touched, setTouched] = useState<(Position | undefined)[]>([]);
  const [verdict, setVerdict] = useState("");
  const { refused, busy, ask } = useRefusal();
  const touch = (step: number) => {
    const pose = chosen && effectorPose(chosen);
    if (!pose) return;
    setVerdict("");
    setTouched((before) => STEPS.map((_, n) => (n === step ? pose.position : before[n])));
  };
  const [origin, onX, inPlane] = touched;
  const place = () =>
    refusal(async () => {
      if (!origin || !onX || !inPlane) return;
      const found = await frameByAxes(origin, onX, [inPlane], { object_id: id, object_name: nameOf(getState(), id) });
      const refusedPose = await placeAt(id, found.pose);
      if (refusedPose) throw new Error(refusedPose);
      setVerdict(verdictOf(found));
      setTouched([]);
    });
  return (
    <details className="by-numbers">
      <summary>{t`With three points`}</summary>
      <div className="actions start">
        {STEPS.map((words, n) => (
          <Button key={n} why={why} onPress={() => touch(n)}>
            {touched[n] && <Icon name="check" size={16} />}
            {i18n._(words)}
          </Button>
        ))}
      </div>
      <Button
        variant="primary"
        why={why || (origin && onX && inPlane ? "" : t`Touch all three points first.`)}
        isDisabled={busy}
        onPress={() => void ask(place())}
      >
        {t`Update the pose`}
      </Button>
      {verdict && (
        <p className="small" role="status">
          {verdict}
        </p>
      )}
      <RefusedText>{refused}</RefusedText>
    </details>
  );
}
