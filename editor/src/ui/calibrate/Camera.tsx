/** The picture of a camera, and its calibration with markers. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { calibrateCamera, checkLens } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { notReady } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { CameraPicture } from "./CameraPicture";
import { Records } from "./Records";
import "./calibrate.css";

const Camera: Section["Body"] = ({ selection: { id } }) => {
  const why = useWhyNot(id, "CalibrateCamera");
  const offline = useEditor((state) => notReady(state, { robotId: id, armId: "", effector: "" }, "CameraColorImage"));
  const [lens, setLens] = useState({ verdict: "", busy: false });
  const { refused, busy, ask } = useRefusal();
  useEffect(() => setLens({ verdict: "", busy: false }), [id]);
  const check = async () => {
    setLens({ verdict: "", busy: true });
    const verdict = await checkLens(id).catch(sentence);
    setLens({ verdict, busy: false });
  };
  return (
    <>
      <CameraPicture key={id} id={id} why={offline} />
      <Button
        icon="point"
        className="wraps"
        why={why || offline}
        isDisabled={busy}
        onPress={() => void ask(calibrateCamera(id))}
      >
        {t`Calibrate with markers`}
      </Button>
      <RefusedText>{refused}</RefusedText>
      <Button className="wraps" why={offline} isDisabled={busy || lens.busy} onPress={() => void check()}>
        {t`Check lens with markers`}
      </Button>
      {lens.verdict && <p role="status">{lens.verdict}</p>}
      <Records id={id} />
    </>
  );
};

export default Camera;
