/** Move single joints within their limits: one step per press, or as long as a button is held. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useState } from "react";
import { holdJog } from "../../commands/holdToRun";
import { featuresOf, moveToJoints, notReady, type RobotSelection } from "../../commands/robot";
import { fixed } from "../../formats";
import type { Joint } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { useEditor } from "../../store/store";
import { telemetry } from "../../store/telemetry";
import { NumberField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { HoldButton } from "./HoldButton";
import { FASTEST, motionOptions, setMotionOptions, useMotionOptions } from "./motionOptions";
import { HOLD_HINT, PadDock } from "./PadDock";
import { useTelemetry } from "./useTelemetry";

const DEGREES = 180 / Math.PI;

interface ShownJoint extends Joint {
  /** Degrees, or millimetres if prismatic, per unit of the value. */
  scale: number;
  unit: string;
  lower: number;
  upper: number;
}

/** Return joints with the limits of the robot's model; infinite where the model states none. */
export function shownJoints(robotId: string, joints: readonly Joint[]): ShownJoint[] {
  const limits = theEngine()?.limits(robotId) ?? [];
  return joints.map((joint) => {
    const limit = limits.find((each) => each.name === joint.name);
    const prismatic = limit?.prismatic ?? false;
    return {
      ...joint,
      scale: prismatic ? 1000 : DEGREES,
      unit: prismatic ? "mm" : "°",
      lower: limit?.lower ?? -Infinity,
      upper: limit?.upper ?? Infinity,
    };
  });
}

export function JointsTab({ chosen }: { chosen: RobotSelection }) {
  const { robotId, armId } = chosen;
  const { press, angle, distance, speed } = useMotionOptions();
  const features = useEditor((state) => featuresOf(state, robotId));
  const why = useEditor((state) => notReady(state, chosen, "MoveToJoints"));
  const joints = useTelemetry(robotId, () => telemetry.latest(robotId)?.joints);
  const [refused, setRefused] = useState("");
  const hold = press === "hold" && features?.jog === true;
  const cannot = why || (hold || features?.move_to_joints ? "" : t`This robot cannot move to joint positions.`);
  if (!joints) return <p className="quiet">{t`The robot reports no joint positions.`}</p>;
  const shown = shownJoints(
    robotId,
    [...joints].map(([name, value]) => ({ name, value })),
  );

  const go = (name: string, value: number) => {
    setRefused("");
    const present = telemetry.latest(robotId)?.joints ?? joints;
    void moveToJoints(
      chosen,
      [...present].map(([each, was]) => ({ name: each, value: each === name ? value : was })),
      motionOptions(),
    ).then(setRefused);
  };
  const jog = (name: string, sign: number, prismatic: boolean) => {
    setRefused("");
    const value = sign * speed * (prismatic ? FASTEST.linear : FASTEST.joint);
    return holdJog(robotId, { joints: [{ name, value }], ...(armId ? { arm_id: armId } : {}) });
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
      {!hold && (
        <NumberField
          label={t`Step`}
          unit="°"
          digits={2}
          value={angle * DEGREES}
          least={0.01}
          most={180}
          onChange={(next) => setMotionOptions({ angle: next / DEGREES })}
        />
      )}
      <PadDock
        chosen={chosen}
        refused={refused}
        hint={cannot || (hold ? i18n._(HOLD_HINT) : t`Each press moves one joint by one step.`)}
      >
        <ul className="joints">
          {shown.map((joint) => {
            const prismatic = joint.unit === "mm";
            const step = prismatic ? distance : angle;
            return (
              <li key={joint.name}>
                <div className="joint-head">
                  <span>{joint.name.replaceAll("_", " ")}</span>
                  <Limits joint={joint} />
                </div>
                {([-1, 1] as const).map((sign) => {
                  const shownName = joint.name.replaceAll("_", " ");
                  const words = hold
                    ? sign > 0
                      ? t`Hold to move ${shownName} up`
                      : t`Hold to move ${shownName} down`
                    : sign > 0
                      ? t`Move ${shownName} up`
                      : t`Move ${shownName} down`;
                  return hold ? (
                    <HoldButton
                      key={sign}
                      label={words}
                      why={cannot}
                      onHold={() => jog(joint.name, sign, prismatic)}
                      onOver={setRefused}
                    >
                      {sign > 0 ? "+" : "−"}
                    </HoldButton>
                  ) : (
                    <Button
                      key={sign}
                      aria-label={words}
                      why={cannot || whyOutsideLimits(joint, joint.value + sign * step)}
                      onPress={() =>
                        go(joint.name, (telemetry.latest(robotId)?.joints.get(joint.name) ?? joint.value) + sign * step)
                      }
                    >
                      {sign > 0 ? "+" : "−"}
                    </Button>
                  );
                })}
                <NumberField
                  label={t`${joint.name.replaceAll("_", " ")} to`}
                  unit={joint.unit}
                  value={joint.value * joint.scale}
                  least={joint.lower * joint.scale}
                  most={joint.upper * joint.scale}
                  isDisabled={cannot !== ""}
                  onChange={(next) => go(joint.name, next / joint.scale)}
                />
              </li>
            );
          })}
        </ul>
      </PadDock>
    </>
  );
}

function whyOutsideLimits({ name, lower, upper, scale, unit }: ShownJoint, value: number): string {
  if (value >= lower && value <= upper) return "";
  const [shownName, least, most] = [name.replaceAll("_", " "), fixed(lower * scale, 0), fixed(upper * scale, 0)];
  return t`Limits of ${shownName}: ${least} to ${most} ${unit}.`;
}

/** Show the position of a joint between its limits. */
export function Limits({ joint: { value, lower, upper, scale, unit } }: { joint: ShownJoint }) {
  if (!Number.isFinite(lower) || !Number.isFinite(upper)) return null;
  const part = Math.min(1, Math.max(0, (value - lower) / (upper - lower)));
  const near = Math.min(part, 1 - part) < 0.05;
  return (
    <span
      className="joint-limits"
      data-near={near}
      title={t`from ${fixed(lower * scale, 0)} to ${fixed(upper * scale, 0)} ${unit}`}
    >
      <span style={{ left: `${part * 100}%` }} />
      {near && <span className="hidden-but-read">{t`near its limit`}</span>}
    </span>
  );
}
