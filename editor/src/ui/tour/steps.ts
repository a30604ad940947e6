/** The guided tours: instructions, and how to detect that the user has followed them. Pure. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import { ROLES } from "../../protocol/types";
import { isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import type { Selection } from "../../store/ui";

interface TourStep {
  text: MessageDescriptor;
  /** Return whether it is done, compared with the state when the step began; without it the user continues. */
  done?: (state: State, began: State) => boolean;
}

const grown = (of: "objects" | "points" | "actions") => (state: State, began: State) =>
  Object.keys(state.doc?.[of] ?? {}).length > Object.keys(began.doc?.[of] ?? {}).length;
const opens = (tool: string) => (state: State) => state.ui.tool === tool;
const selects = (kind: Selection["kind"]) => (state: State) => state.ui.selection?.kind === kind;
const isPaused = ({ program }: State) => program.state === "paused" && !program.held;

const LOOK: TourStep = { text: msg`This is the workplace. Drag to look around, pinch or scroll to zoom.` };
const OBJECTS: TourStep = {
  text: msg`Open “Objects”: everything in the workplace, its points and actions.`,
  done: opens("things"),
};
const ONLINE: TourStep = {
  text: msg`Press “Go online” to connect the devices.`,
  done: (state) => state.live.state === "started",
};
const ROBOT: TourStep = { text: msg`Open “Robot”, where you move the robot.`, done: opens("robot") };
const JOG: TourStep = {
  text: msg`Press an arrow at the bottom of the panel. The robot moves by one step.`,
  done: (state, began) => state.live.motions !== began.live.motions,
};
const TEACH: TourStep = {
  text: msg`Press “+ Point” over the view to store where the robot is.`,
  done: grown("points"),
};
const RUN: TourStep = { text: msg`Open “Run” and press “Save and run”.`, done: isRunning };
const PAUSE: TourStep = {
  text: msg`Press “Pause”, then “Step” to run one action. “Stop motion” stops everything.`,
  done: isPaused,
};

/** Runs programs. */
const OPERATOR: readonly TourStep[] = [
  { text: msg`This screen shows what runs, and the counts of the last run. The button above has all alarms.` },
  { text: msg`Choose what to produce, then press “Start”.`, done: isRunning },
  { text: msg`Press “Pause”. The program stops before its next action.`, done: isPaused },
  { text: msg`Press “Resume” to continue.`, done: ({ program }) => program.state === "running" },
  { text: msg`“Stop” ends the run. “Stop motion” stops everything at once. It is not an emergency stop.` },
];

/** Adapts programs. */
const STANDARD_USER: readonly TourStep[] = [
  LOOK,
  OBJECTS,
  { text: msg`Select an action in the list: the panel shows its parameters.`, done: selects("action") },
  {
    text: msg`Change a value under “Parameters”. Undo, in the bar above, takes it back.`,
    done: ({ doc }, began) => doc?.actions !== began.doc?.actions,
  },
  ONLINE,
  ROBOT,
  JOG,
  RUN,
  PAUSE,
];

/** Sets up workplaces. */
const TECHNICIAN: readonly TourStep[] = [
  LOOK,
  OBJECTS,
  { text: msg`Press “Add object” and choose what to add. “Test connection” tries a device.`, done: grown("objects") },
  { text: msg`Select an object: the arrows in the view and the panel move it.`, done: selects("object") },
  ONLINE,
  {
    text: msg`Open “Devices”: their states, inputs and outputs, interlocks and alarms.`,
    done: opens("devices"),
  },
  ROBOT,
  JOG,
  RUN,
  PAUSE,
];

/** Creates programs. */
export const STEPS: readonly TourStep[] = [
  LOOK,
  OBJECTS,
  ONLINE,
  ROBOT,
  JOG,
  TEACH,
  { text: msg`Open “Program”, where actions are added.`, done: opens("program") },
  { text: msg`Press an action, such as “move”. It follows the selected action.`, done: grown("actions") },
  RUN,
  PAUSE,
];

/** Return the tour for the tasks of a role. */
export function stepsOf(role: number): readonly TourStep[] {
  if (role === ROLES.operator) return OPERATOR;
  if (role === ROLES.standard_user) return STANDARD_USER;
  return role === ROLES.technician ? TECHNICIAN : STEPS;
}
