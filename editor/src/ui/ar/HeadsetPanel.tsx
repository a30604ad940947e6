/** The panel of a headset: quality, selection, touching points, motion and program with Stop in reach. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import type { PanelButton } from "../../ar/panel";
import { leaveAr, openPlacing, programEnded, startHere, xrView } from "../../commands/ar";
import { undo } from "../../commands/documents";
import { holdJog } from "../../commands/holdToRun";
import { step } from "../../commands/move";
import { stopMotion } from "../../commands/operation";
import { chosenRobot, notReady } from "../../commands/robot";
import { notRunnable, pause, resume, run, step as runStep, stop } from "../../commands/run";
import { doingWords } from "../../program/position";
import { whyUnavailable } from "../../store/permissions";
import { isOnline, isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import { getState, useEditor } from "../../store/store";
import type { Ar } from "../../store/ui";
import { turnedAbout } from "../../transform/placing";
import { notMovable, targetOf } from "../../transform/target";
import { nameOf } from "../../viewmodel/names";
import { FASTEST } from "../robot/motionOptions";
import { phaseName } from "../run/RunBar";
import { adviceOf, gradeOf, qualityOf } from "./texts";

/** Turn by a button, rad. */
const TURN = Math.PI / 18;
const AXES = ["x", "y", "z"] as const;

export default function HeadsetPanel({ ar }: { ar: Ar }) {
  const [touching, setTouching] = useState("");
  const [failure, setFailure] = useState("");
  const state = useEditor((all) => all);
  const { word, shape } = gradeOf(ar);
  const selection = state.ui.selection;
  const runs = isRunning(state);
  const robot = isOnline(state) && !runs ? chosenRobot(state) : null;
  const target = targetOf(state, selection);
  const touch = () => {
    setFailure("");
    setTouching("");
    const view = xrView();
    view?.headset?.touch(null);
    if (!view || touching) return;
    void import("./touching").then(({ touchPoints }) =>
      touchPoints(view, setTouching, (reason) => {
        setTouching("");
        setFailure(reason);
      }),
    );
  };
  const outOfReach = ar.stopButton ? "" : t`Motion needs a controller: its buttons A, B, X and Y stop motion.`;
  const unable = robot ? outOfReach || notReady(state, robot) : "";
  const lines = [
    ar.seenAt > 0 && ar.phase !== "hand" ? qualityOf(ar) : "",
    touching || failure || adviceOf(ar),
    selection ? t`Selected: ${nameOf(state, selection.id)}` : t`Select with the ray; press again and hold to move.`,
    runs ? [phaseName(state.program), doingWords(state)].filter(Boolean).join(": ") : "",
    unable || (state.doc?.project ? outOfReach : ""),
  ].filter(Boolean);
  useEffect(() => {
    if (!runs) programEnded();
  }, [runs]);
  const jog = (axis: (typeof AXES)[number], sign: number) => () => {
    if (!robot) return;
    const linear = { x: 0, y: 0, z: 0, [axis]: sign * getState().ui.jogging.speed * FASTEST.linear };
    return holdJog(robot.robotId, {
      frame: "world",
      linear,
      ...(robot.effector ? { end_effector_id: robot.effector } : {}),
      ...(robot.armId ? { arm_id: robot.armId } : {}),
    }).end;
  };
  const turn = (sign: number) => () => {
    const current = targetOf(getState(), getState().ui.selection);
    if (current) step(current, turnedAbout(current.pose, { x: 0, y: 0, z: 1 }, sign * TURN));
  };
  const turns = target?.turns && !notMovable(state, target);
  // Both fit into one row, so that the panel hides little of the workplace.
  const half = turns && state.doc?.project ? 3 : 6;
  const buttons: PanelButton[] = [
    ...(robot
      ? AXES.flatMap((axis) =>
          [-1, 1].map((sign) => ({
            id: `${axis}${sign}`,
            label: `${sign > 0 ? "+" : "−"}${axis.toUpperCase()}`,
            cells: 2,
            disabled: unable !== "",
            press: jog(axis, sign),
          })),
        )
      : []),
    ...(turns
      ? [
          { id: "turn left", label: t`Turn left`, cells: half, press: turn(1) },
          { id: "turn right", label: t`Turn right`, cells: half, press: turn(-1) },
        ]
      : []),
    ...programButtons(state, outOfReach !== "", half),
    { id: "undo", label: t`Undo`, cells: 2, press: undo },
    {
      id: "touch",
      label: touching ? t`Cancel` : t`Touch points`,
      cells: 4,
      disabled: ar.configured === 0,
      press: touch,
    },
    { id: "place", label: t`Place`, cells: 3, press: () => openPlacing(true) },
    { id: "leave", label: t`Leave AR`, cells: 3, press: () => leaveAr() },
    { id: "stop", label: t`Stop motion`, cells: 12, style: "stop", press: stopMotion },
  ];
  useEffect(() => xrView()?.headset?.panel.show({ title: `${shape} ${word}`, lines, buttons }));
  return null;
}

/** Return the buttons of the program. `barred`: it cannot move now; pause and stop are always possible. */
function programButtons(state: State, barred: boolean, half: number): PanelButton[] {
  const { doc, program } = state;
  const button = (id: string, label: string, cells: number, command: () => Promise<unknown>, disabled = false) => ({
    id,
    label,
    cells,
    disabled,
    press: command,
  });
  const moving = (id: string, label: string, cells: number, command: () => Promise<unknown>, disabled = false) =>
    button(id, label, cells, () => startHere(command), disabled || barred);
  if (!isRunning(state)) {
    if (!doc?.project) return [];
    const unable = notRunnable(state) !== "";
    return [
      moving("run", doc.unsaved ? t`Save and run` : t`Run`, half, run, unable),
      moving("run paused", t`Start paused`, half, () => run({ paused: true }), unable),
    ];
  }
  const denied = whyUnavailable(state, "StopPackage") !== "";
  const paused = program.state === "paused" && !program.held;
  return [
    ...(program.state === "running" ? [button("pause", t`Pause`, 6, pause, denied)] : []),
    ...(paused
      ? [moving("resume", t`Resume`, 4, resume, denied), moving("step", t`Step`, 4, () => runStep(), denied)]
      : []),
    button("stop program", t`Stop`, paused ? 4 : 6, stop, denied),
  ];
}
