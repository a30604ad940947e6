/** Sections about objects whose pose a robot or a camera can measure; for scenes. */

import { msg } from "@lingui/core/macro";
import type { SceneObject } from "../../protocol/types";
import { derivesFrom } from "../../store/selectors";
import type { State } from "../../store/state";
import type { Selection } from "../../store/ui";
import { lazyComponent } from "../kit/lazy";
import type { Section } from "../workplace/section";

/** For objects of an open scene, not of a project. */
const inScene = (wanted: (state: State, object: SceneObject) => boolean) => (selection: Selection, state: State) => {
  const object = state.doc?.objects[selection.id];
  return object !== undefined && state.doc?.project === null && wanted(state, object);
};

const isRobot = (state: State, { type }: SceneObject) => type in state.types.robots;
const isCamera = (state: State, { type }: SceneObject) => derivesFrom(state, type, "Camera");
const hasRobots = (state: State) => Object.values(state.doc?.objects ?? {}).some((each) => isRobot(state, each));

export const calibrateSections: readonly Section[] = [
  {
    id: "camera",
    title: msg`Camera`,
    applies: ({ id }, state) => {
      const object = state.doc?.objects[id];
      return object !== undefined && isCamera(state, object);
    },
    Body: lazyComponent(() => import("./Camera")),
  },
  {
    id: "robot-by-camera",
    title: msg`Calibration`,
    applies: inScene(isRobot),
    Body: lazyComponent(() => import("./RobotByCamera")),
  },
  {
    id: "aim",
    title: msg`Measure with tool`,
    applies: inScene(
      (state, { type, pose }) =>
        pose !== undefined &&
        hasRobots(state) &&
        (state.types.byName[type]?.object_model?.mesh?.focus_points?.length ?? 0) > 0,
    ),
    Body: lazyComponent(() => import("./AimWizard")),
  },
  {
    id: "place-by-robot",
    title: msg`Set pose with robot`,
    applies: inScene((state, object) => object.pose !== undefined && hasRobots(state) && !isRobot(state, object)),
    Body: lazyComponent(() => import("./PlaceByRobot")),
  },
];
