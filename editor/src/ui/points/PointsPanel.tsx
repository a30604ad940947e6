/** Points of the project: added by a tap on a surface, at the crosshair, by numbers, or at the robot. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { createPortal } from "react-dom";
import { against, aimedPlace } from "../../commands/crosshair";
import { addPoint, addPointFromRobot } from "../../commands/points";
import { chosenRobot, notReady } from "../../commands/robot";
import { storeGeneralState } from "../../commands/viewstate";
import type { Position } from "../../protocol/types";
import { theEngine } from "../../session/engine";
import { whyUnavailable } from "../../store/permissions";
import { isClosed } from "../../store/selectors";
import { getState, notify, setUi, useEditor } from "../../store/store";
import { composed, ORIGIN, worldOf } from "../../viewmodel/frames";
import { pointSize } from "../../viewmodel/items";
import { nameOf } from "../../viewmodel/names";
import { NumberField, SliderField, SwitchField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { usePlaceTap } from "../robot/usePlaceTap";
import { PointTree } from "./PointTree";
import { RefusedText, useRefusal } from "./Refusal";
import "./points.css";

/**
 * Return a possible parent of a new point: the selected object or point, or the point of the selected orientation,
 * joints or action.
 */
function parentOfSelection(): string {
  const { doc, ui } = getState();
  const id = ui.selection?.id ?? "";
  if (!doc) return "";
  if (doc.points[id] || doc.objects[id]?.pose) return id;
  return (doc.orientations[id] ?? doc.joints[id] ?? doc.actions[id])?.pointId ?? "";
}

export default function PointsPanel() {
  const chosen = useEditor(chosenRobot);
  const selected = useEditor((state) => state.ui.selection?.id);
  const candidate = selected === undefined ? "" : parentOfSelection();
  const parentName = useEditor((state) => (candidate ? nameOf(state, candidate) : ""));
  const why = useEditor((state) =>
    isClosed(state) ? t`A program is running.` : whyUnavailable(state, "AddActionPoint"),
  );
  const noRobot = useEditor((state) => notReady(state, chosen, "AddApUsingRobot"));
  const [on, setOn] = useState<"parent" | "world">("parent");
  const [tapping, setTapping] = useState(false);
  const [withOrientation, setWithOrientation] = useState(true);
  const [typed, setTyped] = useState<Position>(ORIGIN.position);
  const size = useEditor(pointSize);
  const { refused, busy, ask } = useRefusal();
  const parent = candidate && on === "parent" ? candidate : "";
  const added = (work: Promise<string>) =>
    void ask(work).then((done) => {
      if (!done) return;
      setTapping(false);
      setUi({ tool: "" });
    });

  usePlaceTap(tapping, ({ position, normal }) => {
    added(addPoint(position, parent, withOrientation && normal ? against(normal) : undefined));
  });

  const addAtCrosshair = () => {
    const place = aimedPlace();
    if (place) added(addPoint(place.position, parent, withOrientation ? place.orientation : undefined));
    else notify("info", t`Nothing at the crosshair. Aim at the table or an object.`);
  };
  return (
    <>
      <Crosshair />
      {parentName && (
        <ToggleGroup
          label={t`Parent`}
          value={on}
          onChange={setOn}
          choices={[
            ["parent", parentName],
            ["world", t`World`],
          ]}
        />
      )}
      <div className="add-point">
        <Button
          icon="robot"
          variant="primary"
          why={why || noRobot}
          isDisabled={busy}
          onPress={() => chosen && added(addPointFromRobot(chosen))}
        >
          {t`At the robot`}
        </Button>
        <Button icon="point" why={why} isDisabled={busy} aria-pressed={tapping} onPress={() => setTapping(!tapping)}>
          {tapping ? t`Tap in the view…` : t`Where I tap`}
        </Button>
        <Button icon="plus" why={why} isDisabled={busy} onPress={addAtCrosshair}>
          {t`At the crosshair`}
        </Button>
      </div>
      <SwitchField isSelected={withOrientation} onChange={setWithOrientation}>
        {t`Add an orientation facing the surface`}
      </SwitchField>
      <details className="by-numbers">
        <summary>{t`By numbers`}</summary>
        <p className="quiet small">{parent ? t`Relative to ${parentName}.` : t`Relative to the world.`}</p>
        <div className="amounts">
          {(["x", "y", "z"] as const).map((axis) => (
            <NumberField
              key={axis}
              label={axis.toUpperCase()}
              unit="mm"
              value={typed[axis] * 1000}
              step={10}
              onChange={(next) => setTyped({ ...typed, [axis]: next / 1000 })}
            />
          ))}
        </div>
        <Button
          why={why}
          isDisabled={busy}
          onPress={() => {
            const { doc } = getState();
            if (doc) added(addPoint(composed(worldOf(doc, parent), { ...ORIGIN, position: typed }).position, parent));
          }}
        >
          {t`Add point`}
        </Button>
      </details>
      <RefusedText>{refused}</RefusedText>
      <PointTree />
      <SliderField
        label={t`Point size`}
        value={size}
        least={0.5}
        most={4}
        step={0.25}
        words={(value) => `${Math.round(value * 100)} %`}
        onChange={(next) => storeGeneralState({ point_size: next })}
      />
    </>
  );
}

/** A crosshair in the middle of the view. */
function Crosshair() {
  const view = theEngine() && document.querySelector(".view");
  return view && createPortal(<span className="aim-cross" aria-hidden="true" />, view);
}
