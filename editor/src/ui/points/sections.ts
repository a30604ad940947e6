/** What the panel shows of points, orientations and joints. */

import type { Kind } from "../../store/state";
import { lazily } from "../kit/lazily";
import type { Section } from "../workplace/sections";

const of =
  (...kinds: Kind[]): Section["applies"] =>
  ({ kind }) =>
    kinds.includes(kind);

export const pointSections: readonly Section[] = [
  { id: "point", title: "Point", applies: of("point"), Body: lazily(() => import("./PointSection")) },
  {
    id: "orientation",
    title: "Orientation",
    applies: of("orientation"),
    Body: lazily(() => import("./OrientationSection")),
  },
  { id: "joints", title: "Joints", applies: of("joints"), Body: lazily(() => import("./JointsSection")) },
  { id: "go", title: "Robot", applies: of("orientation", "joints"), Body: lazily(() => import("./GoThere")) },
  {
    id: "orientations",
    title: "Orientations",
    applies: of("point"),
    Body: lazily(() => import("./TaughtSection").then((module) => ({ default: module.Orientations }))),
  },
  {
    id: "joints-list",
    title: "Joints",
    applies: of("point"),
    Body: lazily(() => import("./TaughtSection").then((module) => ({ default: module.JointsList }))),
  },
  { id: "copies", title: "Copies", applies: of("point"), Body: lazily(() => import("./CopiesSection")) },
  {
    id: "remove-point",
    title: "Remove",
    applies: of("point"),
    Body: lazily(() => import("./PointSection").then((module) => ({ default: module.RemovePoint }))),
  },
];
