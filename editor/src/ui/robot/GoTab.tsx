/** A pose that is typed, tapped or taken over, shown by a ghost before the robot goes there. */

import { useCallback, useEffect, useState } from "react";
import { type Chosen, effectorPose, hideGhost, moveToPose, notReady, showAt } from "../../commands/robot";
import type { Pose } from "../../protocol/types";
import { now, useEditor } from "../../store/store";
import { alongZ, fromRollPitchYaw, worldOf } from "../../viewmodel/frames";
import { rollPitchYaw } from "../../viewmodel/rotations";
import { Amount, OnOff } from "../kit/fields";
import { Button } from "../kit/kit";
import { nameOf } from "../names";
import { mannerNow } from "./manner";
import { usePlaceTap } from "./usePlaceTap";

const AXES = ["x", "y", "z"] as const;
const ANGLES = ["Roll", "Pitch", "Yaw"] as const;

export function GoTab({ chosen }: { chosen: Chosen }) {
  const why = useEditor((state) => notReady(state, chosen));
  const selection = useEditor((state) => state.ui.selection);
  const selected = useEditor((state) => (selection && selection.kind !== "logic" && selection.kind !== "joints" && selection.id !== chosen.robotId ? nameOf(state, selection.id) : ""));
  const [goal, setGoal] = useState<Pose | null>(() => effectorPose(chosen) ?? null);
  const [tapping, setTapping] = useState(true);
  const [answer, setAnswer] = useState<string | null>(null);
  const [refused, setRefused] = useState("");
  const show = useCallback(
    (next: Pose) => {
      setGoal(next);
      setAnswer(null);
      setRefused("");
      void showAt(chosen, next).then(setAnswer);
    },
    [chosen],
  );
  useEffect(() => hideGhost, []);
  usePlaceTap(tapping, ({ position, normal }) => {
    const turned = goal?.orientation ?? { x: 1, y: 0, z: 0, w: 0 };
    show({ position, orientation: normal ? alongZ({ x: -normal.x, y: -normal.y, z: -normal.z }, turned) : turned });
  });
  if (!goal) {
    return (
      <Button why={why} onPress={() => setGoal(effectorPose(chosen) ?? { position: { x: 0.3, y: 0, z: 0.3 }, orientation: { x: 1, y: 0, z: 0, w: 0 } })}>
        Begin where the tool is
      </Button>
    );
  }
  const angles = rollPitchYaw(goal.orientation);
  return (
    <>
      <OnOff isSelected={tapping} onChange={setTapping}>
        A tap in the view puts the ghost there
      </OnOff>
      <div className="amounts">
        {AXES.map((axis) => (
          <Amount key={axis} label={axis.toUpperCase()} unit="mm" value={goal.position[axis] * 1000} step={10} onChange={(next) => show({ ...goal, position: { ...goal.position, [axis]: next / 1000 } })} />
        ))}
        {ANGLES.map((name, n) => (
          <Amount
            key={name}
            label={name}
            unit="°"
            value={angles[n] ?? 0}
            step={5}
            onChange={(next) => {
              const turned: [number, number, number] = [...angles];
              turned[n] = next;
              show({ ...goal, orientation: fromRollPitchYaw(turned) });
            }}
          />
        ))}
      </div>
      <div className="actions start">
        <Button
          onPress={() => {
            const pose = effectorPose(chosen);
            if (pose) show(pose);
          }}
        >
          Where the tool is
        </Button>
        {selected && (
          <Button
            onPress={() => {
              const { doc, ui } = now();
              if (doc) show(ui.selection?.kind === "orientation" ? worldOf(doc, ui.selection.id) : { ...goal, position: worldOf(doc, ui.selection?.id).position });
            }}
          >
            At {selected}
          </Button>
        )}
      </div>
      <Answer answer={answer} />
      <Button look="primary" why={why || (answer === null ? "Set a goal first: it is shown before the robot goes there." : "")} onPress={() => void moveToPose(chosen, goal, mannerNow()).then(setRefused)}>
        Move there
      </Button>
      {refused && (
        <p className="error small" role="alert">
          {refused}
        </p>
      )}
    </>
  );
}

/** What stands against a goal; null while nothing was asked. */
export function Answer({ answer }: { answer: string | null }) {
  if (answer === null) return null;
  return (
    <p className={`small ${answer ? "error" : "good"}`} role="status">
      {answer || "It can go there: the ghost shows how."}
    </p>
  );
}
