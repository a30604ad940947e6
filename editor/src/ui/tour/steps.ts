/** The guided tour: what to do, and when it is done. Pure. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import { isRunning } from "../../store/selectors";
import type { State } from "../../store/state";

export interface TourStep {
  text: MessageDescriptor;
  /** Return whether it is done, compared with the state when the step began; without it the user continues. */
  done?: (state: State, began: State) => boolean;
}

const grown = (of: "points" | "actions") => (state: State, began: State) =>
  Object.keys(state.doc?.[of] ?? {}).length > Object.keys(began.doc?.[of] ?? {}).length;
const opens = (tool: string) => (state: State) => state.ui.tool === tool;

export const STEPS: readonly TourStep[] = [
  { text: msg`This is the workplace. Drag to look around, pinch or scroll to zoom.` },
  { text: msg`Open “Objects”: everything in the workplace, its points and actions.`, done: opens("things") },
  { text: msg`Press “Go online” to connect the devices.`, done: (state) => state.live.state === "started" },
  { text: msg`Open “Robot”, where you move the robot.`, done: opens("robot") },
  {
    text: msg`Press an arrow at the bottom of the panel. The robot moves by one step.`,
    done: (state, began) => state.live.motions !== began.live.motions,
  },
  { text: msg`Press “+ Point” over the view to store where the robot is.`, done: grown("points") },
  { text: msg`Open “Program”, where actions are added.`, done: opens("program") },
  { text: msg`Press an action, such as “move”. It follows the selected action.`, done: grown("actions") },
  { text: msg`Open “Run” and press “Save and run”.`, done: isRunning },
  {
    text: msg`Press “Pause”, then “Step” to run one action. “Stop motion” stops everything.`,
    done: ({ program }) => program.state === "paused",
  },
];
