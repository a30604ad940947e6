/** How the robot is: where its tool is, what it does, what stopped it, and how the last motion ended. */

import { useState } from "react";
import { acknowledgeStop, armOf, type Chosen, effectorPose, featuresOf, notReady } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { rollPitchYaw } from "../../viewmodel/rotations";
import { Button } from "../kit/kit";
import { nameOf } from "../names";
import { useTelemetry } from "./useTelemetry";

const WORDS = { start: "Moves", end: "Reached", failed: "Not reached" };

export function Status({ chosen }: { chosen: Chosen }) {
  const { robotId } = chosen;
  const motion = useEditor((state) => state.live.motions[robotId]);
  const goal = useEditor((state) => (motion?.goal ? nameOf(state, motion.goal) : ""));
  const hold = useEditor((state) => state.live.holds[robotId]);
  const alarms = useEditor((state) => state.live.health[robotId]?.alarms);
  const acknowledges = useEditor((state) => featuresOf(state, robotId)?.acknowledge_stop ?? false);
  const arm = useEditor((state) => armOf(state, chosen));
  const why = useEditor((state) => notReady(state, chosen, "AcknowledgeStop"));
  const [refused, setRefused] = useState("");
  const tools = [
    ["Grippers", arm?.grippers ?? []],
    ["Suction cups", arm?.suctions ?? []],
  ] as const;
  return (
    <div className="robot-status">
      <Pose chosen={chosen} />
      {tools.map(([what, names]) => names.length > 0 && <p key={what} className="quiet small">{`${what}: ${names.join(", ")}`}</p>)}
      {hold && (
        <p className="tag warn">
          {hold.user} {hold.kind === "jog" ? "holds it" : "moves it by hand"}
        </p>
      )}
      {motion && (
        <p className={`small motion ${motion.phase}`} role="status">
          {WORDS[motion.phase]}
          {goal && ` ${motion.phase === "start" ? "to " : ""}${goal}`}
          {motion.phase === "start" ? "…" : "."} {motion.message}
        </p>
      )}
      {alarms?.map((alarm) => (
        <p key={alarm.code} className="small alarm" role="alert">
          {alarm.text} {alarm.remedy && <span className="quiet">{alarm.remedy}</span>}
        </p>
      ))}
      {acknowledges && alarms && alarms.length > 0 && (
        <Button why={why} onPress={() => void acknowledgeStop(robotId).then(setRefused)}>
          I have looked: acknowledge
        </Button>
      )}
      {refused && (
        <p className="error small" role="alert">
          {refused}
        </p>
      )}
    </div>
  );
}

function Pose({ chosen }: { chosen: Chosen }) {
  const pose = useTelemetry(chosen.robotId, () => effectorPose(chosen));
  if (!pose) return <p className="quiet small">Where its tool is, is not known.</p>;
  const { x, y, z } = pose.position;
  const angles = rollPitchYaw(pose.orientation);
  return (
    <dl className="robot-pose" aria-label="Pose of the tool in the world">
      {(["x", "y", "z"] as const).map((axis, n) => (
        <div key={axis}>
          <dt>{axis}</dt>
          <dd>{(([x, y, z][n] ?? 0) * 1000).toFixed(1)} mm</dd>
          <dd>{(angles[n] ?? 0).toFixed(1)}°</dd>
        </div>
      ))}
    </dl>
  );
}
