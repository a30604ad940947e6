/** The active robot: selection, motion, and the ghost that shows it at another pose. Hold-to-run: holdToRun.ts. */

import { t } from "@lingui/core/macro";
import type { Joint, Pose, RobotArg, RobotFeatures, StepAxis, StepMode, StepWhat } from "../protocol/types";
import { call } from "../session/connection";
import { robotsOf } from "../session/streams";
import { stable } from "../store/memo";
import { whyUnavailable } from "../store/permissions";
import type { Arm, State } from "../store/state";
import { getState, setUi } from "../store/store";
import { telemetry } from "../store/telemetry";
import type { Ghost, MotionOptions } from "../store/ui";
import { refusal, sentence, withLock } from "./requests";
import { storeViewState } from "./viewstate";

/** A robot, its arm (empty if it has one) and its end effector (empty if unknown). */
export interface RobotSelection {
  robotId: string;
  armId: string;
  effector: string;
}

/** Return the active robot: the robot that the user chose last, otherwise the first; null without a robot. */
export const chosenRobot = stable(
  findRobot,
  (one, other) => one?.robotId === other?.robotId && one?.armId === other?.armId && one?.effector === other?.effector,
);

function findRobot(state: State): RobotSelection | null {
  const robots = robotsOf(state);
  const last = (state.view.user.last_robot ?? {}) as Partial<Record<keyof RobotSelection, unknown>>;
  const robotId = robots.find((each) => each === last.robotId) ?? robots[0];
  if (robotId === undefined) return null;
  const arms = state.live.arms[robotId] ?? [];
  const arm = arms.find((each) => each.id === last.armId) ?? arms[0];
  const effector = arm?.effectors.find((each) => each === last.effector) ?? arm?.effectors[0];
  return { robotId, armId: arm?.id ?? "", effector: effector ?? "" };
}

export function chooseRobot(chosen: RobotSelection): void {
  setUi({ ghost: null });
  storeViewState("user", { last_robot: chosen });
}

export function armOf(state: State, { robotId, armId }: RobotSelection): Arm | undefined {
  return state.live.arms[robotId]?.find((each) => each.id === armId);
}

export function featuresOf(state: State, robotId: string): RobotFeatures | undefined {
  return state.types.robots[state.doc?.objects[robotId]?.type ?? ""]?.features;
}

/** Return the robot as requests about points and objects name it. */
export function robotArg({ robotId, armId, effector }: RobotSelection): RobotArg {
  return { robot_id: robotId, end_effector: effector, ...ofArm(armId) };
}

const ofArm = (armId: string) => (armId ? { arm_id: armId } : {});

/** Return the last reported end effector pose; undefined if unknown or outdated. */
export function effectorPose({ robotId, armId, effector }: RobotSelection): Pose | undefined {
  return telemetry
    .endEffectors(robotId)
    .find((each) => each.end_effector_id === effector && (each.arm_id ?? "") === armId)?.pose;
}

/** Return why the robot cannot be moved now; an empty string if it can. */
export function notReady(
  state: State,
  chosen: RobotSelection | null,
  request: Parameters<typeof whyUnavailable>[1] = "MoveToPose",
): string {
  if (!chosen) return t`The scene has no robot.`;
  const name = state.doc?.objects[chosen.robotId]?.name ?? t`The robot`;
  if (state.live.state !== "started") return t`Go online first.`;
  const connection = state.live.objects[chosen.robotId];
  if (connection && connection.state !== "online" && connection.state !== "back")
    return t`${name} is not connected: ${connection.reason || connection.state}.`;
  const hold = state.live.holds[chosen.robotId];
  if (hold && hold.user !== state.connection.user) return t`${hold.user} is moving ${name}.`;
  const owner = state.locks[chosen.robotId];
  if (owner && owner !== state.connection.user) return t`${name} is in use by ${owner}.`;
  return whyUnavailable(state, request);
}

// ------------------------------------------------------------------------------------------------ motion
export interface Step {
  what: StepWhat;
  axis: StepAxis;
  mode: StepMode;
  /** Size of the step, m or rad. */
  step: number;
  /** Pose of the axes, for the mode `relative`. */
  pose?: Pose | undefined;
}

/** Return the reason if the step was refused, otherwise an empty string. */
export function stepEffector(
  { robotId, armId, effector }: RobotSelection,
  { pose, ...step }: Step,
  options: MotionOptions,
): Promise<string> {
  const args = {
    robot_id: robotId,
    end_effector_id: effector,
    ...step,
    ...(pose ? { pose } : {}),
    ...options,
    ...ofArm(armId),
  };
  return refusal(() => withLock(robotId, () => call("StepRobotEef", args, { deadline: 30 })));
}

export function alignDown({ robotId, armId, effector }: RobotSelection, options: MotionOptions): Promise<string> {
  const args = { robot_id: robotId, end_effector_id: effector, ...options, ...ofArm(armId) };
  return refusal(() => withLock(robotId, () => call("SetEefPerpendicularToWorld", args, { deadline: 30 })));
}

/** Move to a pose in the world; omitted parts stay. */
export function moveToPose(
  { robotId, armId, effector }: RobotSelection,
  pose: Partial<Pose>,
  options: MotionOptions,
): Promise<string> {
  return refusal(() =>
    call(
      "MoveToPose",
      { robot_id: robotId, end_effector_id: effector, ...pose, ...options, ...ofArm(armId) },
      { deadline: 30 },
    ),
  );
}

export function moveToJoints(
  { robotId, armId }: RobotSelection,
  joints: Joint[],
  { speed, safe }: MotionOptions,
): Promise<string> {
  return refusal(() =>
    call("MoveToJoints", { robot_id: robotId, joints, speed, safe, ...ofArm(armId) }, { deadline: 30 }),
  );
}

/** Move to an orientation or to joints of a point. */
export function moveToTaught(
  { robotId, armId, effector }: RobotSelection,
  goal: { orientation_id: string } | { joints_id: string },
  options: MotionOptions,
): Promise<string> {
  const to = "orientation_id" in goal ? { ...goal, end_effector_id: effector } : goal;
  return refusal(() =>
    call("MoveToActionPoint", { robot_id: robotId, ...to, ...options, ...ofArm(armId) }, { deadline: 30 }),
  );
}

/** Acknowledge a protective stop, after the user has checked the robot. */
export function acknowledgeStop(object_id: string): Promise<string> {
  return refusal(() => call("AcknowledgeStop", { object_id }, { deadline: 30 }));
}

// ------------------------------------------------------------------------------------------------ ghost
interface GhostOptions {
  /** Return whether the answer is still needed; by default it is. */
  current?: () => boolean;
  /** Whether to show the ghost as unreachable, instead of hiding it, if no joint values reach the pose. */
  keep?: boolean;
}

/**
 * Show the robot at a pose in the world. Return why it cannot be there, or an empty string. A pose in collision is
 * shown too, if there are joints for it.
 */
export async function showGhostAt(
  chosen: RobotSelection,
  pose: Pose,
  { current = () => true, keep = false }: GhostOptions = {},
): Promise<string> {
  const ask = (avoid_collisions: boolean) =>
    call("InverseKinematics", {
      robot_id: chosen.robotId,
      end_effector_id: chosen.effector,
      pose,
      avoid_collisions,
      ...ofArm(chosen.armId),
    });
  const show = (ghost: Ghost | null) => current() && setUi({ ghost });
  try {
    show({ robotId: chosen.robotId, joints: await ask(true), problem: "" });
    return "";
  } catch (error) {
    const problem = sentence(error);
    const joints = await ask(false).catch(() => null);
    const before = getState().ui.ghost;
    if (joints) show({ robotId: chosen.robotId, joints, problem });
    else show(keep && before?.robotId === chosen.robotId ? { ...before, problem } : null);
    return problem;
  }
}

export function showGhostJoints(robotId: string, joints: Joint[], problem = ""): void {
  setUi({ ghost: { robotId, joints, problem } });
}

/** Show the ghost of the robot with its base at a pose in the world. */
export function showGhostWithBase(robotId: string, at: Pose): void {
  const joints = [...(telemetry.latest(robotId)?.joints ?? [])].map(([name, value]) => ({ name, value }));
  setUi({ ghost: { robotId, joints, problem: "", at } });
}

export function hideGhost(): void {
  if (getState().ui.ghost) setUi({ ghost: null });
}
