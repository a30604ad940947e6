/** Measure the pose of a mesh by touching its focus points in turn. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { useStore } from "zustand";
import { createStore } from "zustand/vanilla";
import { type Aiming, beginAiming, frameByPoints, type TouchedFrame } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { chosenRobot, effectorPose, notReady } from "../../commands/robot";
import type { Position } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText } from "../points/Refusal";
import { ToolTab } from "../robot/ToolTab";
import "../points/points.css";
import "../robot/robot.css";
import "./calibrate.css";
import type { Section } from "../workplace/section";

/** Fit of the recorded points; `of` are these points. */
interface Fit {
  of: number[];
  found: TouchedFrame;
}

interface Aim {
  id: string;
  aiming: Aiming | null;
  done: number[];
  touched: Record<number, Position>;
  loadFit: Fit | null;
}

const NONE: Aim = { id: "", aiming: null, done: [], touched: {}, loadFit: null };
/** The running measurement; it continues while other panels are open. */
const aim = createStore<Aim>(() => NONE);

/** Points that define a frame; one more shows the error. */
const NEEDED = 3;

/** Request the fit of the recorded points. */
async function loadFit(known: readonly Position[]): Promise<void> {
  const { touched, aiming } = aim.getState();
  const of = Object.keys(touched).map(Number);
  if (of.length < NEEDED) return;
  const found = await frameByPoints(
    of.map((n) => known[n] ?? { x: 0, y: 0, z: 0 }),
    of.map((n) => touched[n] ?? { x: 0, y: 0, z: 0 }),
  );
  if (aim.getState().aiming === aiming && aim.getState().touched === touched) aim.setState({ loadFit: { of, found } });
}

const AimWizard: Section["Body"] = ({ selection: { id } }) => {
  const chosen = useEditor(chosenRobot);
  const known = useEditor(
    (state) => state.types.byName[state.doc?.objects[id]?.type ?? ""]?.object_model?.mesh?.focus_points,
  );
  const points = known?.length ?? 0;
  const why = useWhyNot(id, "ObjectAimingStart");
  const noRobot = useEditor((state) => notReady(state, chosen, "ObjectAimingStart"));
  const { id: aimedAt, aiming: current, done, loadFit: fitted } = useStore(aim);
  const aiming = aimedAt === id ? current : null;
  const [refused, setRefused] = useState("");
  const [result, setResult] = useState("");
  const trying = async (work: () => Promise<void>) => {
    setRefused("");
    setResult("");
    try {
      await work();
    } catch (error) {
      setRefused(sentence(error));
    }
  };
  const next = Array.from({ length: points }, (_, n) => n).find((n) => !done.includes(n)) ?? -1;
  if (!aiming) {
    return (
      <>
        <p className="quiet small">{t`Touch its ${points} focus points with the robot tool to measure its pose.`}</p>
        <Button
          icon="robot"
          why={why || noRobot || (current ? t`Another object is being measured. Finish that first.` : "")}
          onPress={() =>
            chosen &&
            void trying(async () => {
              aim.setState({ ...NONE, id, aiming: await beginAiming(id, chosen, () => aim.setState(NONE)) });
            })
          }
        >
          {t`Start`}
        </Button>
        {result && (
          <p className="small good" role="status">
            {result}
          </p>
        )}
        <RefusedText>{refused}</RefusedText>
      </>
    );
  }
  const take = async (n: number) => {
    // The server reads the tool position itself; this one is for the preview of the fit.
    const tool = chosen && effectorPose(chosen);
    aim.setState({ done: await aiming.add(n) });
    if (tool) aim.setState((so) => ({ touched: { ...so.touched, [n]: tool.position }, loadFit: null }));
    await loadFit((known ?? []).map((each) => each.position));
  };
  const end = (words: string) => {
    aim.setState(NONE);
    setResult(words);
    theEngine()?.focus(id);
  };
  return (
    <>
      <p role="status">
        {next < 0 ? t`All points are recorded.` : t`Point ${next + 1} of ${points}: move the tool tip onto it.`}
      </p>
      <ol className="focus-points">
        {Array.from({ length: points }, (_, n) => (
          <li key={n}>
            <Button
              look={n === next ? "primary" : ""}
              icon={done.includes(n) ? "check" : "point"}
              onPress={() => void trying(() => take(n))}
            >
              {done.includes(n) ? t`Record point ${n + 1} again` : t`Record point ${n + 1}`}
            </Button>
          </li>
        ))}
      </ol>
      {fitted && <FitSoFar {...fitted} />}
      <div className="actions start">
        <Button
          look="primary"
          why={next < 0 ? "" : t`Record point ${next + 1} first.`}
          onPress={() => void trying(async () => aiming.done().then(() => end(t`Pose updated.`)))}
        >
          {t`Update the pose`}
        </Button>
        <Button onPress={() => void aiming.cancel().then(() => end(""))}>{t`Cancel`}</Button>
      </div>
      <RefusedText>{refused}</RefusedText>
      {chosen && (
        <details className="by-numbers">
          <summary>{t`Move the robot`}</summary>
          <ToolTab chosen={chosen} />
        </details>
      )}
    </>
  );
};

export default AimWizard;

function FitSoFar({ of, found }: Fit) {
  const { checked, residual, residuals, worst } = found;
  const number = (of[worst] ?? 0) + 1;
  return (
    <p className="small" role="status">
      {checked
        ? t`RMS error ${millimetres(residual)}; point ${number} is off by ${millimetres(residuals[worst] ?? 0)}.`
        : t`Three points define the pose. Record a fourth to see the error.`}
    </p>
  );
}

const millimetres = (metres: number) => t`${(metres * 1000).toFixed(1)} mm`;
