/** A target pose: dragged in the view, typed, tapped or copied from an item, and previewed by the ghost. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useCallback, useEffect, useRef, useState } from "react";
import { effectorPose, hideGhost, moveToPose, notReady, type RobotSelection } from "../../commands/robot";
import type { PathState } from "../../engine/pathLine";
import type { Pose } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { getState, useEditor } from "../../store/store";
import { alongZ, fromRollPitchYaw, worldOf } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { rollPitchYaw } from "../../viewmodel/rotations";
import { NumberField, SwitchField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { type GoalAnswer, LiveGoal } from "./liveGoal";
import { motionOptions, useMotionOptions } from "./motionOptions";
import { PadDock } from "./PadDock";
import { useGoalGizmo } from "./useGoalGizmo";
import { usePlaceTap } from "./usePlaceTap";
import { useTelemetry } from "./useTelemetry";

const AXES = ["x", "y", "z"] as const;
const ANGLES = [msg`Roll`, msg`Pitch`, msg`Yaw`] as const;

export function GoTab({ chosen }: { chosen: RobotSelection }) {
  const why = useEditor((state) => notReady(state, chosen));
  const { safe } = useMotionOptions();
  const selection = useEditor((state) => state.ui.selection);
  const selected = useEditor((state) =>
    selection && selection.kind !== "logic" && selection.kind !== "joints" && selection.id !== chosen.robotId
      ? nameOf(state, selection.id)
      : "",
  );
  const [goal, setGoal] = useState<Pose | null>(() => effectorPose(chosen) ?? null);
  const [tapping, setTapping] = useState(true);
  const [turning, setTurning] = useState(false);
  const [answer, setAnswer] = useState<GoalAnswer | null>(null);
  const [refused, setRefused] = useState("");
  const live = useRef<LiveGoal | null>(null);
  useEffect(() => {
    const one = new LiveGoal(chosen, () => motionOptions().linear, setAnswer);
    live.current = one;
    return () => {
      one.forget();
      hideGhost();
    };
  }, [chosen]);
  const show = useCallback((next: Pose) => {
    setGoal(next);
    setRefused("");
    live.current?.ask(next);
  }, []);
  const cancelGoal = () => {
    live.current?.forget();
    hideGhost();
    setAnswer(null);
    setRefused("");
    setGoal(effectorPose(chosen) ?? goal);
  };
  useGoalGizmo(goal, turning ? "turn" : "move", turning ? "goal" : "world", show);
  useStraightPath(chosen, goal, answer);
  usePlaceTap(tapping, ({ position, normal }) => {
    const turned = goal?.orientation ?? { x: 1, y: 0, z: 0, w: 0 };
    show({ position, orientation: normal ? alongZ({ x: -normal.x, y: -normal.y, z: -normal.z }, turned) : turned });
  });
  if (!goal) {
    return (
      <Button
        why={why}
        onPress={() =>
          setGoal(
            effectorPose(chosen) ?? { position: { x: 0.3, y: 0, z: 0.3 }, orientation: { x: 1, y: 0, z: 0, w: 0 } },
          )
        }
      >
        {t`Start at the tool`}
      </Button>
    );
  }
  const angles = rollPitchYaw(goal.orientation);
  const notYet =
    answer === null
      ? t`Set a target first.`
      : answer.goal !== goal
        ? t`Checking the target…`
        : safe
          ? answer.problem
          : "";
  return (
    <>
      <SwitchField isSelected={tapping} onChange={setTapping}>
        {t`Tap in the view to set the target`}
      </SwitchField>
      <ToggleGroup
        label={t`Drag the target`}
        value={turning ? "turn" : "move"}
        choices={[
          ["move", t`Move`],
          ["turn", t`Turn`],
        ]}
        onChange={(next) => setTurning(next === "turn")}
      />
      <Answer answer={answer?.problem ?? null} />
      <PathText answer={answer} />
      <div className="amounts">
        {AXES.map((axis) => (
          <NumberField
            key={axis}
            label={axis.toUpperCase()}
            unit="mm"
            value={goal.position[axis] * 1000}
            step={10}
            onChange={(next) => show({ ...goal, position: { ...goal.position, [axis]: next / 1000 } })}
          />
        ))}
        {ANGLES.map((name, n) => (
          <NumberField
            key={n}
            label={i18n._(name)}
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
      <PadDock chosen={chosen} refused={refused} hint={why || notYet}>
        <div className="actions start">
          <Button
            variant="primary"
            why={why || notYet}
            onPress={() => void moveToPose(chosen, goal, motionOptions()).then(setRefused)}
          >
            {t`Move there`}
          </Button>
          <Button onPress={cancelGoal}>{t`Reset to tool`}</Button>
          {selected && (
            <Button
              onPress={() => {
                const { doc, ui } = getState();
                if (doc)
                  show(
                    ui.selection?.kind === "orientation"
                      ? worldOf(doc, ui.selection.id)
                      : { ...goal, position: worldOf(doc, ui.selection?.id).position },
                  );
              }}
            >
              {t`At ${selected}`}
            </Button>
          )}
        </div>
      </PadDock>
    </>
  );
}

/** Describe the straight path to the target. */
function PathText({ answer }: { answer: GoalAnswer | null }) {
  const { linear } = useMotionOptions();
  const name = useEditor((state) => (answer?.obstacle ? nameOf(state, answer.obstacle) : ""));
  if (!answer || answer.problem) return null;
  if (!linear)
    return <p className="quiet small">{t`The robot does not move in a straight line. The path is not shown.`}</p>;
  if (answer.path === "unknown") return <p className="quiet small">{t`The straight path was not checked.`}</p>;
  if (answer.path === "free") return <p className="small good">{t`The straight path of the tool is free.`}</p>;
  return (
    <p className="small warn">
      {name ? t`The straight path of the tool is blocked by ${name}.` : t`The straight path of the tool is blocked.`}
    </p>
  );
}

/** Show the straight path from the current tool position in the view. */
function useStraightPath(chosen: RobotSelection, goal: Pose | null, answer: GoalAnswer | null): void {
  const { linear } = useMotionOptions();
  const tool = useTelemetry(chosen.robotId, () => effectorPose(chosen));
  const state: PathState = !answer ? "unknown" : linear || answer.problem ? answer.path : "unknown";
  useEffect(() => {
    theEngine()?.showPath(goal && answer && tool ? { from: tool.position, to: goal.position, state } : null);
  }, [goal, tool, answer, state]);
  useEffect(() => () => theEngine()?.showPath(null), []);
}

/** The reason why the target cannot be reached; null before the check. */
export function Answer({ answer }: { answer: string | null }) {
  if (answer === null) return null;
  return (
    <p className={`small ${answer ? "error" : "good"}`} role="status">
      {answer || t`Reachable. The ghost shows the pose.`}
    </p>
  );
}
