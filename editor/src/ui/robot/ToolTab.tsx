/** Move the tool along and about axes: one step per press, or as long as a button is held. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useState } from "react";
import { holdJog } from "../../commands/holdToRun";
import {
  alignDown,
  effectorPose,
  featuresOf,
  moveToPose,
  notReady,
  type RobotSelection,
  stepEffector,
} from "../../commands/robot";
import { decimal } from "../../formats";
import type { Pose, Position, StepAxis } from "../../protocol/types";
import { getState, useEditor } from "../../store/store";
import type { Jogging } from "../../store/ui";
import { worldOf } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { NumberField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { HoldButton } from "./HoldButton";
import { ANGLES, DISTANCES, FASTEST, motionOptions, setMotionOptions, useMotionOptions } from "./motionOptions";
import { HOLD_HINT, PadDock } from "./PadDock";

const AXES: readonly StepAxis[] = ["x", "y", "z"];
const DEGREES = 180 / Math.PI;

/** Return whether a kind of item has a frame of its own. */
function framed(kind: string | undefined): boolean {
  return kind === "object" || kind === "point" || kind === "orientation";
}

export function ToolTab({ chosen }: { chosen: RobotSelection }) {
  const { frame, press: pressed, what, distance, angle, speed } = useMotionOptions();
  const selection = useEditor((state) => state.ui.selection);
  const selected = useEditor((state) =>
    framed(selection?.kind) && selection && selection.id !== chosen.robotId ? nameOf(state, selection.id) : "",
  );
  const features = useEditor((state) => featuresOf(state, chosen.robotId));
  const why = useEditor((state) => notReady(state, chosen, "StepRobotEef"));
  const [refused, setRefused] = useState("");
  const hold = pressed === "hold" && features?.jog === true;
  const used: Jogging["frame"] = frame === "selected" && !selected ? "world" : frame;
  const turning = what === "orientation";
  const cannot = why || (hold || features?.move_to_pose ? "" : t`This robot cannot move to poses.`);

  const press = (axis: StepAxis, sign: number) => {
    setRefused("");
    const pose = poseOf(used, chosen);
    const mode = used === "world" || used === "robot" ? used : "relative";
    void stepEffector(
      chosen,
      { what, axis, mode, step: sign * (turning ? angle : distance), pose },
      motionOptions(),
    ).then(setRefused);
  };
  const jog = (axis: StepAxis, sign: number) => {
    setRefused("");
    const velocity = sign * speed * (turning ? FASTEST.angular : FASTEST.linear);
    const vector: Position = { x: 0, y: 0, z: 0, [axis]: velocity };
    const pose = used === "selected" ? poseOf(used, chosen) : undefined;
    return holdJog(chosen.robotId, {
      frame: used === "selected" ? "user" : used,
      ...(turning ? { angular: vector } : { linear: vector }),
      ...(pose ? { pose } : {}),
      ...(chosen.effector ? { end_effector_id: chosen.effector } : {}),
      ...(chosen.armId ? { arm_id: chosen.armId } : {}),
    });
  };
  const hint = hold
    ? i18n._(HOLD_HINT)
    : turning
      ? t`Each press turns the tool by one step.`
      : t`Each press moves the tool by one step.`;
  const words = (axis: StepAxis, sign: number) => {
    const direction = `${sign > 0 ? "+" : "−"}${axis.toUpperCase()}`;
    if (hold) return turning ? t`Hold to turn about ${direction}` : t`Hold to move along ${direction}`;
    return turning ? t`Turn about ${direction}` : t`Move along ${direction}`;
  };

  return (
    <>
      <ToggleGroup
        label={t`Mode`}
        quiet
        value={hold ? "hold" : "step"}
        onChange={(next) => setMotionOptions({ press: next })}
        choices={
          features?.jog
            ? [
                ["step", t`Step`],
                ["hold", t`Hold to move`],
              ]
            : [["step", t`Step`]]
        }
      />
      <ToggleGroup
        label={t`Motion`}
        quiet
        value={what}
        onChange={(next) => setMotionOptions({ what: next })}
        choices={[
          ["position", t`Move`],
          ["orientation", t`Turn`],
        ]}
      />
      <ToggleGroup
        label={t`Frame`}
        value={used}
        onChange={(next) => setMotionOptions({ frame: next })}
        choices={[
          ["world", t`World`],
          ["robot", t`Robot`],
          ["tool", t`Tool`],
          ...(selected ? [["selected", selected] as const] : []),
        ]}
      />
      {!hold && (turning ? <Angles angle={angle} /> : <Distances distance={distance} />)}
      <div className="actions start">
        <Button
          why={why || (features?.inverse_kinematics ? "" : t`This robot has no inverse kinematics.`)}
          onPress={() => void alignDown(chosen, motionOptions()).then(setRefused)}
        >
          {t`Tool straight down`}
        </Button>
        {selection?.kind === "orientation" && (
          <Button
            why={why}
            onPress={() =>
              void moveToPose(
                chosen,
                { orientation: poseOf("selected", chosen)?.orientation ?? { x: 0, y: 0, z: 0, w: 1 } },
                motionOptions(),
              ).then(setRefused)
            }
          >
            {t`Align with ${selected}`}
          </Button>
        )}
      </div>
      <PadDock chosen={chosen} refused={refused} hint={cannot || hint}>
        <div className="jog-pad">
          {[1, -1].flatMap((sign) =>
            AXES.map((axis) => {
              const content = (
                <>
                  <span className={`axis-${axis}`}>{axis.toUpperCase()}</span>
                  {sign > 0 ? "+" : "−"}
                </>
              );
              return hold ? (
                <HoldButton
                  key={`${axis}${sign}`}
                  label={words(axis, sign)}
                  why={cannot}
                  onHold={() => jog(axis, sign)}
                  onOver={setRefused}
                >
                  {content}
                </HoldButton>
              ) : (
                <Button
                  key={`${axis}${sign}`}
                  aria-label={words(axis, sign)}
                  why={cannot}
                  onPress={() => press(axis, sign)}
                >
                  {content}
                </Button>
              );
            }),
          )}
        </div>
      </PadDock>
    </>
  );
}

/** Return the pose in the world of the frame whose axes are used; undefined for frames that the server knows. */
function poseOf(frame: Jogging["frame"], chosen: RobotSelection): Pose | undefined {
  if (frame === "tool") return effectorPose(chosen);
  const { doc, ui } = getState();
  return frame === "selected" && doc ? worldOf(doc, ui.selection?.id) : undefined;
}

function Distances({ distance }: { distance: number }) {
  return (
    <div className="step-size">
      <ToggleGroup
        label={t`Step, mm`}
        value={String(distance)}
        onChange={(next) => setMotionOptions({ distance: Number(next) })}
        choices={DISTANCES.map((each) => [String(each), decimal(each * 1000, 3)] as const)}
      />
      <NumberField
        label={t`Or`}
        unit="mm"
        digits={2}
        value={distance * 1000}
        least={0.01}
        most={300}
        onChange={(next) => setMotionOptions({ distance: next / 1000 })}
      />
    </div>
  );
}

function Angles({ angle }: { angle: number }) {
  return (
    <div className="step-size">
      <ToggleGroup
        label={t`Step, °`}
        value={String(angle)}
        onChange={(next) => setMotionOptions({ angle: Number(next) })}
        choices={ANGLES.map((each) => [String(each), decimal(each * DEGREES, 1)] as const)}
      />
      <NumberField
        label={t`Or`}
        unit="°"
        digits={2}
        value={angle * DEGREES}
        least={0.01}
        most={180}
        onChange={(next) => setMotionOptions({ angle: next / DEGREES })}
      />
    </div>
  );
}
