/** The running action in words, its duration up to now, and the next steps of the operator. */

import { t } from "@lingui/core/macro";
import { decimal, duration } from "../../formats";
import { isLate, type Step, stepsOf } from "../../program/step";
import { useEditor } from "../../store/store";
import { useTicking } from "../times";

/** `whyNoResume`: why the paused program cannot be resumed here; an empty string if it can. */
export function CurrentStep({ whyNoResume }: { whyNoResume: string }) {
  const state = useEditor((each) => each);
  const paused = state.program.state === "paused";
  const steps = stepsOf(state);
  useTicking(paused ? 0 : 1);
  const late = paused ? undefined : steps.find((each) => isLate(each, Date.now()));
  const doing = steps.map((each) => each.name).join(", ");
  return (
    <>
      {doing && <p className="operator-step">{paused ? t`before ${doing}` : doing}</p>}
      {steps.map((each) => (
        <StepDetail key={each.id} step={each} paused={paused} />
      ))}
      <p className="operator-advice">
        {late
          ? t`This takes longer than usual. Check ${late.device}.`
          : paused
            ? whyNoResume || t`Press Resume to continue, or Step for one action.`
            : state.program.state === "running"
              ? t`The program runs by itself. Press Pause to wait before the next action.`
              : null}
      </p>
    </>
  );
}

function StepDetail({ step, paused }: { step: Step; paused: boolean }) {
  const { device, does, values, started, usual } = step;
  const taken = started === undefined ? 0 : Math.max(0, (Date.now() - started) / 1000);
  return (
    <div className="operator-detail">
      <p>{does ? t`${device}: ${does}` : device}</p>
      {values && <p className="small">{values}</p>}
      {!paused && taken >= 1 && (
        <p className="small" role="timer">
          {usual === undefined
            ? t`running for ${elapsed(taken)}`
            : t`for ${elapsed(taken)}, usually ${duration(usual)}`}
        </p>
      )}
    </div>
  );
}

/** Return a time that passes, in whole seconds. */
const elapsed = (seconds: number): string =>
  seconds < 60 ? `${decimal(Math.floor(seconds))} s` : duration(Math.floor(seconds));
