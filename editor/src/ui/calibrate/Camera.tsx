/** The picture of a camera, and its calibration with markers. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { calibrateCamera, checkLens, takePicture } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { notReady } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { OnOff } from "../kit/fields";
import { Button } from "../kit/kit";
import { useWhyNot } from "../points/editing";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { Records } from "./Records";
import "./calibrate.css";

/** Time between two pictures, s. */
const PAUSE = 0.5;

const Camera: Section["Body"] = ({ selection: { id } }) => {
  const why = useWhyNot(id, "CalibrateCamera");
  const offline = useEditor((state) => notReady(state, { robotId: id, armId: "", effector: "" }, "CameraColorImage"));
  const [picture, setPicture] = useState("");
  const [follow, setFollow] = useState(false);
  const [failed, setFailed] = useState("");
  const [lens, setLens] = useState({ verdict: "", busy: false });
  const { refused, busy, ask } = useRefusal();
  useEffect(() => () => URL.revokeObjectURL(picture), [picture]);
  useEffect(() => {
    setPicture("");
    setFollow(false);
    setFailed("");
    setLens({ verdict: "", busy: false });
  }, [id]);
  const check = async () => {
    setLens({ verdict: "", busy: true });
    const verdict = await checkLens(id).catch(sentence);
    setLens({ verdict, busy: false });
  };
  const take = async () => {
    try {
      setPicture(URL.createObjectURL(await takePicture(id)));
      setFailed("");
      return true;
    } catch (error) {
      setFailed(sentence(error));
      return false;
    }
  };
  useEffect(() => {
    if (!follow || offline) return;
    let over = false;
    const again = async () => {
      while (!over) {
        if (!document.hidden && !(await take())) break;
        await new Promise((resolve) => setTimeout(resolve, PAUSE * 1000));
      }
      if (!over) setFollow(false);
    };
    void again();
    return () => {
      over = true;
    };
  }, [follow, offline, id]);
  return (
    <>
      {picture && <img className="camera-picture" src={picture} alt={t`Camera picture`} />}
      <div className="actions start">
        <Button why={offline} onPress={() => void take()}>
          {t`Take a picture`}
        </Button>
        <OnOff isSelected={follow} onChange={(on) => (offline ? setFailed(offline) : setFollow(on))}>
          {t`Live picture`}
        </OnOff>
      </div>
      <RefusedText>{failed}</RefusedText>
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
