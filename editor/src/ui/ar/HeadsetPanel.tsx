/** What the panel of a headset shows: quality, selection, registration by touch, and motion with Stop in reach. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import type { PanelButton } from "../../ar/panel";
import type { Touched } from "../../ar/touch";
import { leaveAr, openPlacing, xrView } from "../../commands/ar";
import { undo } from "../../commands/documents";
import { holdJog } from "../../commands/holdToRun";
import { step } from "../../commands/move";
import { stopMotion } from "../../commands/operation";
import { chosenRobot, notReady } from "../../commands/robot";
import { isOnline } from "../../store/selectors";
import { now, useEditor } from "../../store/store";
import type { Ar } from "../../store/ui";
import { turnedAbout } from "../../transform/placing";
import { notMovable, targetOf } from "../../transform/target";
import { nameOf } from "../../viewmodel/names";
import { FASTEST } from "../robot/motionOptions";
import { adviceOf, gradeOf, qualityOf } from "./words";

/** Turn by a button, rad. */
const TURN = Math.PI / 18;
const CORNERS: readonly MessageDescriptor[] = [
  msg`upper left corner`,
  msg`upper right corner`,
  msg`lower right corner`,
  msg`lower left corner`,
];
const AXES = ["x", "y", "z"] as const;

export default function HeadsetPanel({ ar }: { ar: Ar }) {
  const [touching, setTouching] = useState(-1);
  const [failure, setFailure] = useState("");
  const state = useEditor((all) => all);
  const { word, shape } = gradeOf(ar);
  const selection = state.ui.selection;
  const robot = isOnline(state) ? chosenRobot(state) : null;
  const target = targetOf(state, selection);
  const known = xrView()?.headset?.known ?? [];
  const nameOfPoint = (n: number) => {
    const { marker = 0, corner = 0 } = known[n] ?? {};
    return t`marker ${marker}, ${i18n._(CORNERS[corner] as MessageDescriptor)}`;
  };
  const touch = () => {
    const view = xrView();
    setFailure("");
    const starts = touching < 0;
    setTouching(starts ? 0 : -1);
    view?.touch(starts ? setTouching : undefined, (result) => {
      setTouching(-1);
      setFailure(failureOf(result, nameOfPoint));
    });
  };
  const unable = robot ? whyNot(ar, notReady(state, robot)) : "";
  const point = touching >= 0 ? nameOfPoint(touching) : "";
  const lines = [
    ar.seenAt > 0 && ar.phase !== "hand" ? qualityOf(ar) : "",
    point
      ? t`Touch ${touching + 1} of ${known.length}: ${point}. Hold still while you press.`
      : failure || adviceOf(ar),
    selection ? t`Selected: ${nameOf(state, selection.id)}` : t`Select with the ray; press again and hold to move.`,
    unable,
  ].filter(Boolean);
  const act = (run: () => void) => () => {
    run();
    return undefined;
  };
  const jog = (axis: (typeof AXES)[number], sign: number) => () => {
    if (!robot) return undefined;
    const linear = { x: 0, y: 0, z: 0, [axis]: sign * now().ui.jogging.speed * FASTEST.linear };
    return holdJog(robot.robotId, {
      frame: "world",
      linear,
      ...(robot.effector ? { end_effector_id: robot.effector } : {}),
      ...(robot.armId ? { arm_id: robot.armId } : {}),
    }).end;
  };
  const turn = (sign: number) => () => {
    const current = targetOf(now(), now().ui.selection);
    if (current) step(current, turnedAbout(current.pose, { x: 0, y: 0, z: 1 }, sign * TURN));
    return undefined;
  };
  const turns = target?.turns && !notMovable(state, target);
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
          { id: "turn left", label: t`Turn left`, cells: 6, press: turn(1) },
          { id: "turn right", label: t`Turn right`, cells: 6, press: turn(-1) },
        ]
      : []),
    { id: "undo", label: t`Undo`, cells: 2, press: act(() => void undo()) },
    {
      id: "touch",
      label: touching >= 0 ? t`Cancel` : t`Touch points`,
      cells: 4,
      disabled: known.length < 3,
      press: act(touch),
    },
    { id: "place", label: t`Place`, cells: 3, press: act(() => openPlacing(true)) },
    { id: "leave", label: t`Leave AR`, cells: 3, press: act(leaveAr) },
    { id: "stop", label: t`Stop motion`, cells: 12, look: "stop", press: act(() => void stopMotion()) },
  ];
  useEffect(() => xrView()?.headset?.panel.show({ title: `${shape} ${word}`, lines, buttons }));
  return null;
}

/** Return why no motion is allowed: Stop has to be in reach by a button, too. */
function whyNot({ stopButton }: Ar, unready: string): string {
  return stopButton ? unready : t`Motion needs a controller: its buttons A, B, X and Y stop motion.`;
}

function failureOf(result: Touched, nameOfPoint: (n: number) => string): string {
  if (!("problem" in result)) return "";
  if (result.problem === "line") return t`The touched points are on a line. Touch the named corners again.`;
  if (result.points.length === 3) return t`The touched points contradict each other. Touch all of them again.`;
  const names = result.points.map(nameOfPoint).join("; ");
  return t`Not where it should be: ${names}. Touch the points again, or measure the marker.`;
}
