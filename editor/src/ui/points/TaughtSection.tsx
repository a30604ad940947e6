/** Orientations and joints of a point, with their reachability. */

import { t } from "@lingui/core/macro";
import {
  addJointsFromRobot,
  addOrientation,
  addOrientationFromRobot,
  removeJoints,
  removeOrientation,
} from "../../commands/points";
import { chosenRobot, notReady } from "../../commands/robot";
import { theEngine } from "../../session/engine";
import { getState, select, useEditor } from "../../store/store";
import type { Kind } from "../../store/ui";
import { relativeTo, worldOf } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { More } from "../kit/lazyControls";
import type { Section } from "../workplace/section";
import { useWhyNot } from "./editing";
import { ReachBadge } from "./Reach";
import { RefusedText, useRefusal } from "./Refusal";

const DOWN = { x: 1, y: 0, z: 0, w: 0 };

export const Orientations: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const chosen = useEditor(chosenRobot);
  const why = useWhyNot(id, "AddActionPointOrientation");
  const noRobot = useEditor((state) => notReady(state, chosen, "AddActionPointOrientationUsingRobot"));
  const { refused, busy, ask } = useRefusal();
  const taught = Object.values(doc?.orientations ?? {}).filter((each) => each.pointId === id);
  const down = () => {
    const open = getState().doc;
    if (!open) return;
    const { orientation } = relativeTo(worldOf(open, id), { ...worldOf(open, id), orientation: DOWN });
    void ask(addOrientation(id, orientation, "down"));
  };
  return (
    <>
      <ul className="taught">
        {taught.map((each) => (
          <li key={each.id}>
            <Taught kind="orientation" id={each.id} name={each.name} />
            <Button
              variant="plain"
              icon="close"
              aria-label={t`Remove orientation ${each.name}`}
              why={why}
              isDisabled={busy}
              onPress={() => void ask(removeOrientation(each.id))}
            />
          </li>
        ))}
      </ul>
      <div className="actions start">
        <Button
          icon="robot"
          why={why || noRobot}
          isDisabled={busy}
          onPress={() => chosen && void ask(addOrientationFromRobot(id, chosen))}
        >
          {t`From the robot`}
        </Button>
        <More
          label={t`Add orientation`}
          icon="plus"
          variant=""
          choices={[
            { id: "down", label: t`Tool straight down`, why: why, act: down },
            {
              id: "parent",
              label: t`Same as the parent`,
              why: why,
              act: () => void ask(addOrientation(id, { x: 0, y: 0, z: 0, w: 1 })),
            },
          ]}
        >
          {t`Add`}
        </More>
      </div>
      <RefusedText>{refused}</RefusedText>
    </>
  );
};

export const JointsList: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const chosen = useEditor(chosenRobot);
  const why = useWhyNot(id, "AddActionPointJointsUsingRobot");
  const noRobot = useEditor((state) => notReady(state, chosen, "AddActionPointJointsUsingRobot"));
  const robots = useEditor((state) =>
    Object.values(doc?.joints ?? {})
      .map((each) => nameOf(state, each.robot_id))
      .join("\n"),
  ).split("\n");
  const { refused, busy, ask } = useRefusal();
  const taught = Object.values(doc?.joints ?? {})
    .map((each, n) => ({ ...each, robot: robots[n] ?? "" }))
    .filter((each) => each.pointId === id);
  return (
    <>
      <ul className="taught">
        {taught.map((each) => (
          <li key={each.id}>
            <Taught kind="joints" id={each.id} name={`${each.name} · ${each.robot}`} />
            {!each.is_valid && <span className="tag warn">{t`point has moved`}</span>}
            <Button
              variant="plain"
              icon="close"
              aria-label={t`Remove joints ${each.name}`}
              why={why}
              isDisabled={busy}
              onPress={() => void ask(removeJoints(each.id))}
            />
          </li>
        ))}
      </ul>
      <Button
        icon="robot"
        why={why || noRobot}
        isDisabled={busy}
        onPress={() => chosen && void ask(addJointsFromRobot(id, chosen))}
      >
        {t`From the robot`}
      </Button>
      <RefusedText>{refused}</RefusedText>
    </>
  );
};

/** A button that selects an orientation or joints; the view highlights it under the pointer. */
function Taught({ kind, id, name }: { kind: Kind; id: string; name: string }) {
  return (
    <Button
      className="taught-name"
      variant="plain"
      onPress={() => select({ kind, id })}
      onHoverStart={() => theEngine()?.hover(id)}
      onHoverEnd={() => theEngine()?.hover("")}
    >
      <Icon name={kind === "joints" ? "robot" : "point"} size={18} />
      {name}
      <ReachBadge id={id} />
    </Button>
  );
}
