/** Measure the pose of a mesh by touching its focus points in turn. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { cancelMeasurement, finishMeasurement, recordFocusPoint, startMeasurement } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { chosenRobot, notReady } from "../../commands/robot";
import { fixed } from "../../formats";
import { theEngine } from "../../session/engine";
import { useEditor } from "../../store/store";
import type { Fit } from "../../store/ui";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText } from "../points/Refusal";
import { ToolTab } from "../robot/ToolTab";
import "../points/points.css";
import "../robot/robot.css";
import "./calibrate.css";
import type { Section } from "../workplace/section";

const AimWizard: Section["Body"] = ({ selection: { id } }) => {
  const chosen = useEditor(chosenRobot);
  const known = useEditor(
    (state) => state.types.byName[state.doc?.objects[id]?.type ?? ""]?.object_model?.mesh?.focus_points,
  );
  const points = known?.length ?? 0;
  const why = useWhyNot(id, "ObjectAimingStart");
  const noRobot = useEditor((state) => notReady(state, chosen, "ObjectAimingStart"));
  const running = useEditor((state) => state.ui.measurement);
  const measurement = running?.objectId === id ? running : null;
  const recorded = measurement?.recorded ?? [];
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
  const next = Array.from({ length: points }, (_, n) => n).find((n) => !recorded.includes(n)) ?? -1;
  if (!measurement) {
    return (
      <>
        <p className="quiet small">{t`Touch its ${points} focus points with the robot tool to measure its pose.`}</p>
        <Button
          icon="robot"
          why={why || noRobot || (running ? t`Another object is being measured. Finish that first.` : "")}
          onPress={() => chosen && void trying(() => startMeasurement(id, chosen))}
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
  const take = (n: number) =>
    recordFocusPoint(
      n,
      chosen,
      (known ?? []).map((each) => each.position),
    );
  const end = (words: string) => {
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
              variant={n === next ? "primary" : ""}
              icon={recorded.includes(n) ? "check" : "point"}
              onPress={() => void trying(() => take(n))}
            >
              {recorded.includes(n) ? t`Record point ${n + 1} again` : t`Record point ${n + 1}`}
            </Button>
          </li>
        ))}
      </ol>
      {measurement.fit && <CurrentFit {...measurement.fit} />}
      <div className="actions start">
        <Button
          variant="primary"
          why={next < 0 ? "" : t`Record point ${next + 1} first.`}
          onPress={() => void trying(() => finishMeasurement().then(() => end(t`Pose updated.`)))}
        >
          {t`Update the pose`}
        </Button>
        <Button onPress={() => void cancelMeasurement().then(() => end(""))}>{t`Cancel`}</Button>
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

function CurrentFit({ checked, rms, worst, worstPoint }: Fit) {
  return (
    <p className="small" role="status">
      {checked
        ? t`RMS error ${millimetres(rms)}; point ${worstPoint + 1} is off by ${millimetres(worst)}.`
        : t`Three points define the pose. Record a fourth to see the error.`}
    </p>
  );
}

const millimetres = (metres: number) => `${fixed(metres * 1000, 1)} mm`;
