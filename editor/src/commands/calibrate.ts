/** Where things stand, found out by robots and cameras. Each gives why it was refused, empty when it was done or begun. */

import { t } from "@lingui/core/macro";
import { createStore } from "zustand/vanilla";
import type { Pivot, Pose, Position } from "../protocol/types";
import { refusedWith } from "../session/assets";
import { call } from "../session/connection";
import { remembered } from "../session/memory";
import { now, setUi, store } from "../store/store";
import { FLIPPED, pivotOffset } from "../transform/pivots";
import { composed } from "../viewmodel/frames";
import { held, refusal } from "./asking";
import { type Chosen, robotArg } from "./robot";

/** Put an object where the robot's tool points; `pivot` is which of its places is touched. */
export const placeByRobot = (id: string, chosen: Chosen, pivot: Pivot) =>
  refusal(() => call("UpdateObjectPoseUsingRobot", { id, robot: robotArg(chosen), pivot }));

/** Show an object where `placeByRobot` would put it, with the tool at a pose in the world; gives why it cannot be. */
export function showAtTool(id: string, tool: Pose, pivot: Pivot): string {
  const state = now();
  const of = state.doc?.objects[id];
  const offset = pivotOffset(state.types.byName[of?.type ?? ""]?.object_model, pivot);
  if (!of || typeof offset === "string") return typeof offset === "string" ? offset : t`It no longer exists.`;
  const pose = composed(tool, { position: { x: 0, y: 0, z: -offset }, orientation: FLIPPED });
  setUi({ draft: { id, of, pose } });
  return "";
}

/** Show it where it stands again. */
export function hideAtTool(id: string): void {
  if (now().ui.draft?.id === id) setUi({ draft: undefined });
}

// ------------------------------------------------------------------------------------------------ aiming
/** An aiming that is under way: it holds the object and the robot until it is over. */
export interface Aiming {
  /** Take the tool's place for a focus point; gives those that are done. */
  add: (index: number) => Promise<number[]>;
  /** Put the object where its points were found. */
  done: () => Promise<void>;
  cancel: () => Promise<void>;
}

/** Begin; rejects with why it was refused. `onLost` is called when it ends by itself. */
export function beginAiming(id: string, chosen: Chosen, onLost: () => void): Promise<Aiming> {
  return new Promise((resolve, reject) => {
    held(id, () =>
      held(chosen.robotId, async () => {
        await call("ObjectAimingStart", { object_id: id, robot: robotArg(chosen) });
        await new Promise<void>((over) => {
          // The server forgets it with the connection, and when the scene goes offline.
          const stop = store.subscribe((state) => {
            if (state.connection.status === "ready" && state.live.state === "started") return;
            stop();
            onLost();
            over();
          });
          resolve({
            add: async (point_idx) => (await call("ObjectAimingAddPoint", { point_idx })).finished_indexes,
            done: async () => {
              await call("ObjectAimingDone");
              stop();
              over();
            },
            cancel: () =>
              call("ObjectAimingCancel")
                .catch(() => {}) // the connection or the scene is gone, and it with them
                .then(() => {
                  stop();
                  over();
                }),
          });
        });
      }),
    ).catch(reject);
  });
}

// ------------------------------------------------------------------------------------------------ cameras
export const calibrateCamera = (id: string) =>
  refusal(() => held(id, () => remembering(id, () => call("CalibrateCamera", { id }, { deadline: 30 }))));

export const calibrateRobot = (robot_id: string, camera_id: string, move_to_calibration_pose: boolean) =>
  refusal(() =>
    held(robot_id, () =>
      remembering(robot_id, () =>
        call("CalibrateRobot", { robot_id, camera_id, move_to_calibration_pose }, { deadline: 30 }),
      ),
    ),
  );

/** Where the thing that was calibrated last stood before, until somebody has said that its new place is right. */
export const before = createStore<{ id: string; pose: Pose | null }>(() => ({ id: "", pose: null }));
export const keepPlace = (): void => before.setState({ id: "", pose: null });

async function remembering(id: string, begin: () => Promise<unknown>): Promise<void> {
  const pose = now().doc?.objects[id]?.pose ?? null;
  await begin();
  before.setState({ id, pose });
}

/** Take a picture; a JPEG, whose bytes come as one character each. Rejects with why it was refused. */
export async function takePicture(id: string): Promise<Blob> {
  const text = await held(id, () => call("CameraColorImage", { id }, { deadline: 20 }));
  return new Blob([Uint8Array.from(text, (each) => each.charCodeAt(0))], { type: "image/jpeg" });
}

// ------------------------------------------------------------------------------------------------ records and touching
export interface CalibrationRecord {
  id: string;
  date: string;
  person: string;
  verdict: string;
  residual?: number;
  residual_unit?: string;
}

async function rest<T>(path: string, options: RequestInit = {}): Promise<T> {
  const token = remembered("token");
  const headers: Record<string, string> = {
    "Content-Type": "application/json",
    ...(token ? { Authorization: `Bearer ${token}` } : {}),
  };
  const response = await fetch(path, { ...options, headers });
  if (!response.ok) throw new Error(await refusedWith(response, t`The server refused the request`));
  return (await response.json()) as T;
}

/** The newest records of an object. */
export const recordsOf = (object: string) =>
  rest<CalibrationRecord[]>(`/api/calibrations?object_id=${encodeURIComponent(object)}&limit=3`);

export interface TouchedFrame {
  pose: Pose;
  grade: string;
  verdict: string;
  /** m, of each point, in the order given; `checked`: there are more than are needed, so that they say something. */
  residuals: number[];
  residual: number;
  worst: number;
  checked: boolean;
}

/** The frame of points that are known in it, and were touched, in the same order; nothing is kept of it. */
export const frameByPoints = (known: Position[], touched: Position[]) =>
  rest<TouchedFrame>("/api/calibration/touch/frame-by-points", {
    method: "PUT",
    body: JSON.stringify({ known, touched }),
  });

/** The frame of three touched points: its origin, one on its x axis, one in its xy plane. */
export const frameByAxes = (
  origin: Position,
  on_x: Position,
  in_plane: Position[],
  record: { object_id: string; object_name: string },
) =>
  rest<TouchedFrame>("/api/calibration/touch/frame-by-axes", {
    method: "PUT",
    body: JSON.stringify({ origin, on_x, in_plane, record }),
  });

export const placeAt = (object_id: string, pose: Pose) =>
  refusal(() => held(object_id, () => call("UpdateObjectPose", { object_id, pose })));
