/** Sections of the panel about points, orientations and joints. */

import { msg } from "@lingui/core/macro";
import type { Kind } from "../../store/ui";
import { lazyComponent } from "../kit/lazy";
import type { Section } from "../workplace/section";

const of =
  (...kinds: Kind[]): Section["applies"] =>
  ({ kind }) =>
    kinds.includes(kind);

export const pointSections: readonly Section[] = [
  { id: "point", title: msg`Point`, applies: of("point"), Body: lazyComponent(() => import("./PointSection")) },
  {
    id: "orientation",
    title: msg`Orientation`,
    applies: of("orientation"),
    Body: lazyComponent(() => import("./OrientationSection")),
  },
  { id: "joints", title: msg`Joints`, applies: of("joints"), Body: lazyComponent(() => import("./JointsSection")) },
  {
    id: "go",
    title: msg`Robot`,
    applies: of("orientation", "joints"),
    Body: lazyComponent(() => import("./MoveRobot")),
  },
  {
    id: "orientations",
    title: msg`Orientations`,
    applies: of("point"),
    Body: lazyComponent(() => import("./TaughtSection").then((module) => ({ default: module.Orientations }))),
  },
  {
    id: "joints-list",
    title: msg`Joints`,
    applies: of("point"),
    Body: lazyComponent(() => import("./TaughtSection").then((module) => ({ default: module.JointsList }))),
  },
  { id: "copies", title: msg`Copies`, applies: of("point"), Body: lazyComponent(() => import("./CopiesSection")) },
  {
    id: "remove-point",
    title: msg`Remove`,
    applies: of("point"),
    Body: lazyComponent(() => import("./PointSection").then((module) => ({ default: module.RemovePoint }))),
  },
];
