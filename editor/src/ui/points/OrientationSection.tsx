/** An orientation: name, angles, reachability, update from the robot. */

import { t } from "@lingui/core/macro";
import { removeOrientation, renameOrientation, turnOrientation, turnOrientationToRobot } from "../../commands/points";
import { chosenRobot, notReady } from "../../commands/robot";
import { select, useEditor } from "../../store/store";
import { fromRollPitchYaw } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { rollPitchYaw } from "../../viewmodel/rotations";
import { NumberField } from "../kit/fields";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { useWhyNot } from "./editing";
import { NameField } from "./NameField";
import { ReachAnswers } from "./Reach";
import { RefusedText, useRefusal } from "./Refusal";
import { Remove } from "./Remove";
import "./points.css";

const OrientationSection: Section["Body"] = ({ selection: { id } }) => {
  const one = useEditor((state) => state.doc?.orientations[id]);
  const point = useEditor((state) => (one ? nameOf(state, one.pointId) : ""));
  const chosen = useEditor(chosenRobot);
  const why = useWhyNot(id, "UpdateActionPointOrientation");
  const noRobot = useEditor((state) => notReady(state, chosen, "UpdateActionPointOrientationUsingRobot"));
  const { refused, busy, ask } = useRefusal();
  if (!one) return null;
  const angles = rollPitchYaw(one.orientation);
  return (
    <>
      <NameField
        key={id}
        label={t`Orientation name`}
        name={one.name}
        why={why}
        onRename={(name) => renameOrientation(id, name)}
      />
      <Button variant="plain" icon="point" onPress={() => select({ kind: "point", id: one.pointId })}>
        {t`at ${point}`}
      </Button>
      <div className="amounts">
        {([t`Roll`, t`Pitch`, t`Yaw`] as const).map((name, n) => (
          <NumberField
            key={name}
            label={name}
            unit="°"
            step={5}
            value={angles[n] ?? 0}
            isDisabled={why !== "" || busy}
            onChange={(next) => {
              const turned: [number, number, number] = [...angles];
              turned[n] = next;
              void ask(turnOrientation(id, fromRollPitchYaw(turned)));
            }}
          />
        ))}
      </div>
      <Button
        icon="robot"
        why={why || noRobot}
        isDisabled={busy}
        onPress={() => chosen && void ask(turnOrientationToRobot(id, chosen))}
      >
        {t`Update from robot`}
      </Button>
      <RefusedText>{refused}</RefusedText>
      <ReachAnswers id={id} />
      <Remove key={`remove ${id}`} name={one.name} why={why} along="" onRemove={() => removeOrientation(id)} />
    </>
  );
};

export default OrientationSection;
