/** Pose of the selected item, and its controls: drag in the view, steps, numbers. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { Suspense, useState } from "react";
import { beginMove, place, step } from "../../commands/move";
import { storeGeneralState } from "../../commands/viewstate";
import type { GizmoMode } from "../../engine/gizmo/handles";
import { translated } from "../../i18n/choices";
import type { ObjectModel, Pose } from "../../protocol/types";
import type { State } from "../../store/state";
import { getState, notify, useEditor } from "../../store/store";
import type { Selection } from "../../store/ui";
import {
  ANGLE_STEPS,
  type AngleUnit,
  LENGTH_STEPS,
  type LengthUnit,
  stepWords,
  type Unit,
} from "../../transform/amounts";
import {
  AXES,
  type Axis,
  angles,
  type FrameName,
  moved,
  placedAt,
  poseFrom,
  poseText,
  same,
  squared,
  turned,
  turnedTo,
} from "../../transform/placing";
import { measures } from "../../transform/sizes";
import { notMovable, notSizable, type Target, targetOf } from "../../transform/target";
import { type Snap, TOOL, type ToolSettings, toolSettings } from "../../transform/tool";
import { relativeTo } from "../../viewmodel/frames";
import { nameOf } from "../../viewmodel/names";
import { NumberField, SelectField, ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { NumberPad } from "./NumberPad";
import { Row } from "./Row";
import { toolFrame, useGizmo } from "./useGizmo";
import "./transform.css";

const Carry = lazyComponent(() => import("./Carry"));

const SNAPS: readonly (readonly [Snap, MessageDescriptor])[] = [
  ["none", msg`none`],
  ["grid", msg`steps`],
  ["surface", msg`surfaces`],
  ["point", msg`other objects`],
];
const keep = (change: Partial<ToolSettings>) =>
  storeGeneralState({ [TOOL]: { ...toolSettings(getState()), ...change } });
/** Choice of a custom step. */
const FREE = "free";

export default function Place({ selection }: { selection: Selection }) {
  const target = useTarget(selection);
  if (!target) return <p className="quiet">{t`This has no pose of its own.`}</p>;
  return <Placing key={selection.id} selection={selection} target={target} />;
}

/** The target; rendered again after each change. */
function useTarget(selection: Selection): Target | null {
  useEditor((state) => state.doc);
  useEditor((state) => state.ui.draft);
  useEditor((state) => state.types.byName);
  return targetOf(getState(), selection);
}

function Placing({ selection, target }: { selection: Selection; target: Target }) {
  const settings = useEditor(toolSettings);
  const whyNot = useEditor((state) => notMovable(state, target));
  const whySize = useEditor((state) => notSizable(state, target));
  const tablet = useEditor(({ ui }) => ui.ar !== null && ui.ar.mode !== "headset");
  const [wanted, setMode] = useState<GizmoMode>(target.moves ? "move" : "turn");
  const [open, setOpen] = useState("");
  const [before, setBefore] = useState<{ pose: Pose; model?: ObjectModel }>({ pose: target.pose, model: target.model });
  const mode = wanted === "size" && !target.model ? "move" : wanted;
  useGizmo(selection, mode);
  const state = getState();
  const frame = toolFrame(state, target);
  const why = mode === "size" ? whySize : whyNot;
  const relative = settings.frame === "own" || settings.frame === "view";
  const modes: [GizmoMode, string][] = [];
  if (target.moves) modes.push(["move", t`Move`]);
  if (target.turns) modes.push(["turn", t`Turn`]);
  if (target.model) modes.push(["size", t`Size`]);
  const changed = !same(before.pose, target.pose) || JSON.stringify(before.model) !== JSON.stringify(target.model);
  const settle = (pose: Pose, model?: ObjectModel) =>
    void place(targetOf(getState(), selection) ?? target, pose, model);
  return (
    <>
      {modes.length > 1 && (
        <ToggleGroup
          label={t`Change`}
          quiet
          value={mode}
          choices={modes}
          onChange={(next) => (setMode(next), setOpen(""))}
        />
      )}
      {why && <p className="small quiet">{why}</p>}
      <div className="axis-rows">
        {mode === "size"
          ? target.model && (
              <Sizes model={target.model} target={target} settings={settings} why={why} open={open} onOpen={setOpen} />
            )
          : AXES.map((axis) => (
              <Coordinate
                key={axis}
                {...{ axis, mode, target, settings, frame, relative, why, selection }}
                open={open === axis}
                onOpen={(on) => setOpen(on ? axis : "")}
              />
            ))}
      </div>
      {tablet && mode !== "size" && (
        <Suspense fallback={null}>
          <Carry selection={selection} turns={mode === "turn"} why={why} />
        </Suspense>
      )}
      <div className="tool-settings">
        <Steps settings={settings} turn={mode === "turn"} />
        {mode !== "size" && (
          <SelectField
            label={t`Frame`}
            value={settings.frame}
            choices={framesOf(state, target)}
            onChange={(value) => keep({ frame: value as FrameName })}
          />
        )}
        <SelectField
          label={t`Snap to`}
          value={settings.snap}
          choices={translated(SNAPS)}
          onChange={(value) => keep({ snap: value as Snap })}
        />
      </div>
      <div className="actions start">
        <Button
          icon="undo"
          isDisabled={!changed || why !== ""}
          onPress={() => {
            settle(before.pose, before.model !== target.model ? before.model : undefined);
          }}
        >
          {t`Reset`}
        </Button>
        {target.turns && (
          <Button
            isDisabled={why !== ""}
            onPress={() => settle({ ...target.pose, orientation: squared(target.pose.orientation, frame.orientation) })}
          >
            {t`Align to axes`}
          </Button>
        )}
        <Button onPress={() => void copy(target.pose)}>{t`Copy`}</Button>
        <Button isDisabled={why !== ""} onPress={() => void paste(target, settle)}>
          {t`Paste`}
        </Button>
        {changed && (
          <Button variant="plain" onPress={() => setBefore({ pose: target.pose, model: target.model })}>
            {t`Set as start`}
          </Button>
        )}
      </div>
    </>
  );
}

interface CoordinateProps {
  axis: Axis;
  mode: GizmoMode;
  target: Target;
  settings: ToolSettings;
  frame: Pose;
  /** The frame moves with the item or the camera: only relative changes are possible. */
  relative: boolean;
  why: string;
  selection: Selection;
  open: boolean;
  onOpen: (on: boolean) => void;
}

const ANGLES: Record<Axis, MessageDescriptor> = { x: msg`Roll`, y: msg`Pitch`, z: msg`Yaw` };

function Coordinate({ axis, mode, target, settings, frame, relative, why, selection, open, onOpen }: CoordinateProps) {
  const turn = mode === "turn";
  const seen = relativeTo(frame, target.pose);
  const value = relative ? 0 : turn ? (angles(seen.orientation)[AXES.indexOf(axis)] ?? 0) : seen.position[axis];
  const unit: Unit = turn ? settings.angle : settings.length;
  const size = turn ? settings.angleStep : settings.lengthStep;
  const label = turn && !relative ? i18n._(ANGLES[axis]) : axis.toUpperCase();
  const by = (pose: Pose, amount: number) =>
    turn ? turned(pose, frame, axis, amount) : moved(pose, frame, axis, amount);
  return (
    <>
      <Row
        label={label}
        value={value}
        unit={unit}
        step={size}
        why={why}
        open={open}
        onOpen={() => (why ? notify("info", why) : onOpen(!open))}
        onSteps={(steps) => {
          const latest = targetOf(getState(), selection);
          if (latest) step(latest, by(latest.pose, steps * size));
        }}
      />
      {open && (
        <NumberPad
          label={label}
          value={value}
          unit={unit}
          by={settings.by}
          onlyBy={relative}
          onUnit={(next) => keep(turn ? { angle: next as AngleUnit } : { length: next as LengthUnit })}
          onBy={(next) => keep({ by: next })}
          onDone={(next) => {
            const latest = targetOf(getState(), selection) ?? target;
            const pose = relative
              ? by(latest.pose, next)
              : turn
                ? turnedTo(latest.pose, frame, axis, next)
                : placedAt(latest.pose, frame, axis, next);
            void place(latest, pose);
          }}
          onClose={() => onOpen(false)}
        />
      )}
    </>
  );
}

interface SizesProps {
  model: ObjectModel;
  target: Target;
  settings: ToolSettings;
  why: string;
  open: string;
  onOpen: (label: string) => void;
}

function Sizes({ model, target, settings, why, open, onOpen }: SizesProps) {
  const latest = (label: string) => {
    const at = targetOf(getState(), { kind: "object", id: target.id }) ?? target;
    return { at, measure: measures(at.model ?? model).find((each) => each.label === label) };
  };
  const put = (label: string, value: number) => {
    const { at, measure } = latest(label);
    if (measure) void place(at, at.pose, measure.put(value));
  };
  return measures(model).map(({ label, value }) => (
    <div key={label}>
      <Row
        label={label}
        value={value}
        unit={settings.length}
        step={settings.lengthStep}
        why={why}
        open={open === label}
        onOpen={() => (why ? notify("info", why) : onOpen(open === label ? "" : label))}
        onSteps={(steps) => {
          const { at, measure } = latest(label);
          if (!measure) return;
          const one = beginMove(at);
          one.moveTo(at.pose, measure.put(measure.value + steps * settings.lengthStep));
          one.settle();
        }}
      />
      {open === label && (
        <NumberPad
          label={label}
          value={value}
          unit={settings.length}
          by={settings.by}
          onUnit={(next) => keep({ length: next as LengthUnit })}
          onBy={(next) => keep({ by: next })}
          onDone={(next) => put(label, next)}
          onClose={() => onOpen("")}
        />
      )}
    </div>
  ));
}

/** The step of the wheel: a predefined or a custom one. */
function Steps({ settings, turn }: { settings: ToolSettings; turn: boolean }) {
  const [free, setFree] = useState(false);
  const steps = turn ? ANGLE_STEPS : LENGTH_STEPS;
  const value = turn ? settings.angleStep : settings.lengthStep;
  const put = (next: number) => keep(turn ? { angleStep: next } : { lengthStep: next });
  const known = steps.find(([each]) => Math.abs(each - value) < 1e-12);
  const choices: [string, string][] = steps.map(([each]) => [String(each), stepWords(each, turn ? "angle" : "length")]);
  choices.push([FREE, known ? t`other…` : stepWords(value, turn ? "angle" : "length")]);
  const factor = turn ? Math.PI / 180 : 0.001;
  return (
    <>
      <SelectField
        label={t`Step`}
        value={known && !free ? String(known[0]) : FREE}
        choices={choices}
        onChange={(next) => (setFree(next === FREE), next === FREE || put(Number(next)))}
      />
      {(free || !known) && (
        <NumberField
          label={t`Custom step`}
          unit={turn ? "°" : "mm"}
          digits={3}
          value={value / factor}
          least={0.001}
          most={10_000}
          onChange={(next) => put(next * factor)}
        />
      )}
    </>
  );
}

function framesOf(state: State, target: Target): [FrameName, string][] {
  const parent =
    target.kind === "point" ? state.doc?.points[target.id]?.parent : state.doc?.orientations[target.id]?.pointId;
  const robots = Object.values(state.doc?.objects ?? {}).some((each) => each.type in state.types.robots);
  const choices: [FrameName, string][] = [["world", t`World`]];
  if (parent) choices.push(["parent", nameOf(state, parent)]);
  if (robots) choices.push(["robot", t`Robot base`]);
  choices.push(["own", t`Object`], ["view", t`View`]);
  // A frame that does not exist here counts as the world.
  const { frame } = toolSettings(state);
  if (!choices.some(([each]) => each === frame)) choices.push([frame, t`World (no parent)`]);
  return choices;
}

async function copy(pose: Pose): Promise<void> {
  const text = poseText(pose);
  try {
    await navigator.clipboard.writeText(text);
    notify("info", t`Copied the pose in the world: position in m and quaternion.`);
  } catch {
    notify("info", text); // without HTTPS there is no clipboard: the text can be selected and copied
  }
}

async function paste(target: Target, settle: (pose: Pose) => void): Promise<void> {
  const text = await navigator.clipboard.readText().catch(() => null);
  if (text === null) return notify("info", t`The browser blocks the clipboard. Enter the numbers instead.`);
  const pose = poseFrom(text, target.pose);
  if (pose) settle(pose);
  else
    notify(
      "info",
      t`The clipboard contains no pose. Copy 3 numbers (position in m), 4 (quaternion), or 6 or 7 (both).`,
    );
}
