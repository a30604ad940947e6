/** Poses of objects measured by robots and cameras. Functions return why they were refused, or an empty string. */

import { t } from "@lingui/core/macro";
import { type ServerMessage, translate } from "../i18n/serverMessages";
import type { MarkerCorners, Pivot, Pose, Position } from "../protocol/types";
import { call } from "../session/connection";
import { rest } from "../session/rest";
import { getState, setUi, store } from "../store/store";
import { FLIPPED, pivotOffset } from "../transform/pivots";
import { composed, ORIGIN } from "../viewmodel/frames";
import { refusal, withLock } from "./requests";
import { effectorPose, type RobotSelection, robotArg } from "./robot";

/** Set the pose of an object from the robot tool; `pivot` is the touched part of the object. */
export const placeByRobot = (id: string, chosen: RobotSelection, pivot: Pivot) =>
  refusal(() => call("UpdateObjectPoseUsingRobot", { id, robot: robotArg(chosen), pivot }));

/** Preview `placeByRobot` with the tool at a pose in the world. Return why it is impossible, or an empty string. */
export function showAtTool(id: string, tool: Pose, pivot: Pivot): string {
  const state = getState();
  const of = state.doc?.objects[id];
  const offset = pivotOffset(state.types.byName[of?.type ?? ""]?.object_model, pivot);
  if (!of || typeof offset === "string") return typeof offset === "string" ? offset : t`It no longer exists.`;
  const pose = composed(tool, { position: { x: 0, y: 0, z: -offset }, orientation: FLIPPED });
  setUi({ draft: { id, of, pose } });
  return "";
}

/** End the preview. */
export function hideAtTool(id: string): void {
  if (getState().ui.draft?.id === id) setUi({ draft: undefined });
}

// ------------------------------------------------------------------------------------------------ focus points
declare module "../store/runtime" {
  interface Runtime {
    /** Releases the locks of the measurement; its state is `ui.measurement`. */
    endMeasurement?: (() => void) | undefined;
  }
}

/** Start to measure an object, which locks it and the robot until the end. Reject with the reason if refused. */
export function startMeasurement(objectId: string, chosen: RobotSelection): Promise<void> {
  return new Promise((resolve, reject) => {
    withLock(objectId, () =>
      withLock(chosen.robotId, async () => {
        await call("ObjectAimingStart", { object_id: objectId, robot: robotArg(chosen) });
        await new Promise<void>((over) => {
          // The server cancels it on disconnect and when the scene goes offline.
          const stop = store.subscribe((state) => {
            if (state.connection.status !== "ready" || state.live.state !== "started") endMeasurement();
          });
          getState().runtime.endMeasurement = () => {
            stop();
            over();
          };
          setUi({ measurement: { objectId, recorded: [], touched: {}, fit: null } });
          resolve();
        });
      }),
    ).catch(reject);
  });
}

/** Number of points that define a frame; one more shows the error. */
const NEEDED = 3;

/** Record the tool position as a focus point, and update the fit. `known`: coordinates of the focus points. */
export async function recordFocusPoint(
  index: number,
  chosen: RobotSelection | null,
  known: readonly Position[],
): Promise<void> {
  // The server reads the tool position itself; this one is for the preview of the fit.
  const tool = chosen && effectorPose(chosen);
  const recorded = (await call("ObjectAimingAddPoint", { point_idx: index })).finished_indexes;
  const { measurement } = getState().ui;
  if (!measurement) return;
  const touched = tool ? { ...measurement.touched, [index]: tool.position } : measurement.touched;
  const fit = tool ? null : measurement.fit;
  setUi({ measurement: { ...measurement, recorded, touched, fit } });
  const numbers = Object.keys(touched).map(Number);
  if (numbers.length < NEEDED) return;
  const { checked, residual, residuals, worst } = await frameByPoints(
    numbers.map((n) => known[n] ?? ORIGIN.position),
    numbers.map((n) => touched[n] ?? ORIGIN.position),
  );
  const latest = getState().ui.measurement;
  if (latest?.touched !== touched) return; // another point was recorded meanwhile
  const found = { checked, rms: residual, worst: residuals[worst] ?? 0, worstPoint: numbers[worst] ?? 0 };
  setUi({ measurement: { ...latest, fit: found } });
}

/** Set the pose of the object from the recorded points, and end the measurement. */
export async function finishMeasurement(): Promise<void> {
  await call("ObjectAimingDone");
  endMeasurement();
}

export async function cancelMeasurement(): Promise<void> {
  // If the connection or the scene is closed, the server has cancelled it.
  await call("ObjectAimingCancel").catch(() => {});
  endMeasurement();
}

function endMeasurement(): void {
  const { runtime } = getState();
  runtime.endMeasurement?.();
  runtime.endMeasurement = undefined;
  setUi({ measurement: null });
}

// ------------------------------------------------------------------------------------------------ cameras
export const calibrateCamera = (id: string) =>
  refusal(() => withLock(id, () => storingOldPose(id, () => call("CalibrateCamera", { id }, { deadline: 30 }))));

export const calibrateRobot = (robot_id: string, camera_id: string, move_to_calibration_pose: boolean) =>
  refusal(() =>
    withLock(robot_id, () =>
      storingOldPose(robot_id, () =>
        call("CalibrateRobot", { robot_id, camera_id, move_to_calibration_pose }, { deadline: 30 }),
      ),
    ),
  );

/** Forget the pose before the calibration: the user has accepted or reverted the new one. */
export const forgetOldPose = (): void => setUi({ beforeCalibration: null });

async function storingOldPose(id: string, begin: () => Promise<unknown>): Promise<void> {
  const pose = getState().doc?.objects[id]?.pose ?? null;
  await begin();
  setUi({ beforeCalibration: pose && { id, pose } });
}

/** Take a picture. Reject with the reason if refused. */
export async function takePicture(id: string): Promise<Blob> {
  return (await rest(`/api/cameras/${encodeURIComponent(id)}/picture`)).blob();
}

/** Return the markers that the server finds in a picture of a camera, with their corners in pixels. */
export async function markersIn(id: string, picture: Blob): Promise<MarkerCorners[]> {
  const bytes = new Uint8Array(await picture.arrayBuffer());
  // The protocol sends a picture as a text with one character per byte.
  const image = new TextDecoder("x-user-defined")
    .decode(bytes)
    .replace(/[\uf780-\uf7ff]/g, (each) => String.fromCharCode(each.charCodeAt(0) - 0xf700));
  const camera_parameters = await withLock(id, () => call("CameraColorParameters", { id }));
  return call("MarkersCorners", { camera_parameters, image });
}

// -------------------------------------------------------------------------------- history and touched points
/** A verdict in English, and its translation. */
interface Judged extends Omit<ServerMessage, "text"> {
  verdict: string;
}

/** Return a verdict in the user's language. */
export const verdictOf = ({ verdict, key, values }: Judged): string => translate({ text: verdict, key, values });

export interface CalibrationRecord extends Judged {
  id: string;
  date: string;
  person: string;
  residual?: number;
  residual_unit?: string;
}

async function json<T>(...request: Parameters<typeof rest>): Promise<T> {
  return (await (await rest(...request)).json()) as T;
}

/** Return the newest calibrations of an object. */
export const recordsOf = (object: string) =>
  json<CalibrationRecord[]>(`/api/calibrations?object_id=${encodeURIComponent(object)}&limit=3`);

/** Compare the focal length of a camera with the markers in a picture. Return the verdict; reject with the reason. */
export async function checkLens(id: string): Promise<string> {
  const picture = await takePicture(id);
  const camera_parameters = await withLock(id, () => call("CameraColorParameters", { id }));
  const body = new FormData();
  body.append("image", picture, "picture.jpg");
  body.append("args", JSON.stringify({ camera_parameters }));
  return verdictOf(await json<Judged>("/api/calibration/lens", { method: "PUT", body }));
}

interface TouchedFrame extends Judged {
  pose: Pose;
  grade: string;
  /**
   * Errors of the points, m, in the given order. `checked`: there are enough points for the errors to be meaningful.
   */
  residuals: number[];
  residual: number;
  worst: number;
  checked: boolean;
}

/** Return the frame of points with known coordinates that were touched in the same order. Nothing is stored. */
const frameByPoints = (known: Position[], touched: Position[]) =>
  json<TouchedFrame>("/api/calibration/touch/frame-by-points", {
    method: "PUT",
    json: { known, touched },
  });

/** Return the frame of three touched points: origin, a point on the x axis, a point in the xy plane. */
export const frameByAxes = (
  origin: Position,
  on_x: Position,
  in_plane: Position[],
  record: { object_id: string; object_name: string },
) =>
  json<TouchedFrame>("/api/calibration/touch/frame-by-axes", {
    method: "PUT",
    json: { origin, on_x, in_plane, record },
  });

export const placeAt = (object_id: string, pose: Pose) =>
  refusal(() => withLock(object_id, () => call("UpdateSceneObjectPose", { object_id, pose })));
