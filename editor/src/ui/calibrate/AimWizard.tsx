/** Where a mesh stands, by touching its focus points one after the other. */

import { useState } from "react";
import { useStore } from "zustand";
import { createStore } from "zustand/vanilla";
import { sentence } from "../../commands/asking";
import { type Aiming, beginAiming } from "../../commands/calibrate";
import { chosenRobot, notReady } from "../../commands/robot";
import { theEngine } from "../../session/engine";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { RefusedText } from "../points/Doing";
import { useWhyNot } from "../points/editing";
import { ToolTab } from "../robot/ToolTab";
import "../points/points.css";
import "../robot/robot.css";
import "./calibrate.css";
import type { Section } from "../workplace/sections";

/** What is aimed at; it goes on while other panels are open. */
const aim = createStore<{ id: string; aiming: Aiming | null; done: number[] }>(() => ({ id: "", aiming: null, done: [] }));

const AimWizard: Section["Body"] = ({ selection: { id } }) => {
  const chosen = useEditor(chosenRobot);
  const points = useEditor((state) => state.types.byName[state.doc?.objects[id]?.type ?? ""]?.object_model?.mesh?.focus_points?.length ?? 0);
  const why = useWhyNot(id, "ObjectAimingStart");
  const noRobot = useEditor((state) => notReady(state, chosen, "ObjectAimingStart"));
  const { id: aimedAt, aiming: current, done } = useStore(aim);
  const aiming = aimedAt === id ? current : null;
  const [refused, setRefused] = useState("");
  const [told, setTold] = useState("");
  const trying = async (work: () => Promise<void>) => {
    setRefused("");
    setTold("");
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
        <p className="quiet small">{`Touch its ${points} focus points with the robot's tool: then it is known where it stands.`}</p>
        <Button
          icon="robot"
          why={why || noRobot || (current ? "Something else is aimed at: finish that first." : "")}
          onPress={() =>
            chosen &&
            void trying(async () => {
              aim.setState({ id, aiming: await beginAiming(id, chosen, () => aim.setState({ aiming: null })), done: [] });
            })
          }
        >
          Begin to aim
        </Button>
        {told && (
          <p className="small good" role="status">
            {told}
          </p>
        )}
        <RefusedText>{refused}</RefusedText>
      </>
    );
  }
  const end = (words: string) => {
    aim.setState({ aiming: null });
    setTold(words);
    theEngine()?.focus(id);
  };
  return (
    <>
      <p role="status">{next < 0 ? "All points are taken." : `Point ${next + 1} of ${points}: put the tool's tip on it.`}</p>
      <ol className="focus-points">
        {Array.from({ length: points }, (_, n) => (
          <li key={n}>
            <Button look={n === next ? "primary" : ""} icon={done.includes(n) ? "check" : "point"} onPress={() => void trying(async () => aim.setState({ done: await aiming.add(n) }))}>
              {done.includes(n) ? `Take point ${n + 1} again` : `The tool is on point ${n + 1}`}
            </Button>
          </li>
        ))}
      </ol>
      <div className="actions start">
        <Button look="primary" why={next < 0 ? "" : `Point ${next + 1} is missing.`} onPress={() => void trying(async () => aiming.done().then(() => end("It stands where its points were found.")))}>
          Put it there
        </Button>
        <Button onPress={() => void aiming.cancel().then(() => end(""))}>Give up</Button>
      </div>
      <RefusedText>{refused}</RefusedText>
      {chosen && (
        <details className="by-numbers">
          <summary>Move the robot</summary>
          <ToolTab chosen={chosen} />
        </details>
      )}
    </>
  );
};

export default AimWizard;
