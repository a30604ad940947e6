/** Icons of devices and services by the icon that their object type declares. A separate chunk. */

import type { ObjectTypeMeta } from "../../protocol/types";
import { PATHS } from "./icons";

const DEVICES = {
  camera: "M4 8h4l1.500-2h5L16 8h4v11H4zM12 10a3.500 3.500 0 1 0 0 7 3.500 3.500 0 0 0 0-7z",
  gripper: "M12 3v5M5 8h14M7 8v6l3 5M17 8v6l-3 5",
  machine: "M4 4h16v16H4zM7 8h10v7H7zM8 18h.01M12 18h.01",
  printer: "M7 9V4h10v5M5 9h14v8h-3v3H8v-3H5zM8 14h8",
  reader: "M5 6v12M8 6v12M11 6v12M15 6v12M19 6v12",
  light: "M9 3h6v5H9zM9 8h6v5H9zM9 13h6v5H9zM7 21h10M12 18v3",
  io: "M4 7h16v10H4zM8 11v2M12 11v2M16 11v2",
  belt: "M6 9h12a3 3 0 0 1 0 6H6a3 3 0 0 1 0-6zM6 12h.01M12 12h.01M18 12h.01",
  cloud: "M7 18h10a4 4 0 0 0 .500-8A6 6 0 0 0 6 10.500 3.800 3.800 0 0 0 7 18z",
  clock: "M12 4a8 8 0 1 0 0 16 8 8 0 0 0 0-16zM12 8v4l3 2",
  fork: "M6 4v6c0 3 6 3 6 6v4M18 4v6c0 3-6 3-6 6",
} as const;

const ICONS: Record<string, string> = {
  ...DEVICES,
  robot: PATHS.robot,
  suction: DEVICES.gripper,
  axis: DEVICES.belt,
  scale: DEVICES.machine,
  service: DEVICES.cloud,
  time: DEVICES.clock,
  flow: DEVICES.fork,
  logic: DEVICES.fork,
  counter: PATHS.list,
  random: DEVICES.fork,
};

/** Return the path of the icon of an object type; a box for one that declares none. */
export const deviceIcon = (type: Pick<ObjectTypeMeta, "icon"> | undefined): string =>
  ICONS[type?.icon ?? ""] ?? PATHS.box;
