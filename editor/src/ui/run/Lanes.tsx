/** The branches that run in parallel: the action of each, and a button to step one while the others wait. */

import { t } from "@lingui/core/macro";
import { step } from "../../commands/run";
import type { Lane } from "../../program/lanes";
import { whyUnavailable } from "../../store/permissions";
import { select, useEditor } from "../../store/store";
import { selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import "./lanes.css";

export function Lanes({ lanes }: { lanes: readonly Lane[] }) {
  const state = useEditor((each) => each);
  const why = whyUnavailable(state, "StepAction");
  const paused = state.program.state === "paused";
  if (lanes.length === 0) return null;
  const show = (lane: Lane) => select(selectionOf(state, lane.actionId));
  return (
    <ul className="run-lanes" aria-label={t`Branches`}>
      {lanes.map((lane) => (
        <li key={lane.id} aria-label={lane.name}>
          <Button variant="plain" className="run-lane" onPress={() => show(lane)}>
            <strong>{lane.name}</strong>
            <span className="small quiet">
              {paused ? (lane.doing ? t`before ${lane.doing}` : t`waiting`) : lane.doing || t`running`}
            </span>
          </Button>
          {paused && !state.program.held && (
            <Button icon="step" why={why} aria-label={t`Step ${lane.name}`} onPress={() => void step("over", lane.id)}>
              {t`Step`}
            </Button>
          )}
        </li>
      ))}
    </ul>
  );
}
