/** The pose at which the view draws a device whose type has no pose. */

import { t } from "@lingui/core/macro";
import { aimedPlace } from "../../commands/crosshair";
import { placeDevice } from "../../commands/places";
import { whyUnavailable } from "../../store/permissions";
import { notify, useEditor } from "../../store/store";
import { placeOf } from "../../viewmodel/devices";
import { Button } from "../kit/kit";

/** Sine and cosine of half a quarter turn. */
const HALF = Math.SQRT1_2;

export function Placing({ id }: { id: string }) {
  const pose = useEditor((state) => {
    const object = state.doc?.objects[id];
    return object && !object.pose ? placeOf(state, object) : undefined;
  });
  const why = useEditor((state) => whyUnavailable(state, "SetViewState"));
  const place = () => {
    const at = aimedPlace();
    if (at) placeDevice(id, { position: at.position, orientation: pose?.orientation ?? { x: 0, y: 0, z: 0, w: 1 } });
    else notify("info", t`Nothing at the crosshair.`);
  };
  const turn = () => {
    if (!pose) return;
    const { x, y, z, w } = pose.orientation;
    const turned = { x: HALF * (x - y), y: HALF * (y + x), z: HALF * (z + w), w: HALF * (w - z) };
    placeDevice(id, { ...pose, orientation: turned });
  };
  return (
    <>
      <div className="actions start">
        <Button icon="point" why={why} onPress={place}>
          {t`Move to the view center`}
        </Button>
        {pose && (
          <>
            <Button variant="plain" why={why} onPress={turn}>
              {t`Turn by 90°`}
            </Button>
            <Button variant="plain" why={why} onPress={() => placeDevice(id, null)}>
              {t`Remove from the view`}
            </Button>
          </>
        )}
      </div>
      <p className="quiet small">{t`Only the view uses this pose. Programs do not.`}</p>
    </>
  );
}
