/** Position of the puck of an action, Start or End: at its point, or where a user moved it. */

import { t } from "@lingui/core/macro";
import { aimedPlace } from "../../commands/crosshair";
import { notEditable, placePuck } from "../../commands/program";
import { placeKey } from "../../program/steps";
import { notify, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import "./program.css";

const Puck: Section["Body"] = ({ selection: { id, kind } }) => {
  const placed = useEditor((state) => placeKey(state.doc, id) in state.view.shared);
  const why = useEditor((state) => notEditable(state, "PreviewMove"));
  const move = () => {
    const place = aimedPlace();
    if (place) void placePuck(id, { ...place.position, z: place.position.z + 0.02 });
    else notify("info", t`Nothing at the crosshair.`);
  };
  return (
    <>
      <p className="quiet small">{t`Drag the puck in the view. The program does not change.`}</p>
      <div className="row">
        <Button variant="plain" why={why} onPress={move}>
          {t`Move to the view center`}
        </Button>
        {placed && (
          <Button variant="plain" why={why} onPress={() => void placePuck(id, null)}>
            {kind === "action" ? t`Reset position` : t`Reset position`}
          </Button>
        )}
      </div>
    </>
  );
};
export default Puck;
