/** A small picture of the workplace, kept with it for all: taken from the view when it is saved, shown on its tile. */

import { t } from "@lingui/core/macro";
import { create } from "zustand";
import { call, serves } from "../session/connection";
import { theEngine } from "../session/engine";
import { barred } from "../store/permissions";
import { openId } from "../store/selectors";
import { now } from "../store/store";
import { refusal } from "./asking";

/** px, and how many signs it may have at most. */
const WIDTH = 320;
const HEIGHT = 180;
const MOST = 48_000;
/** The first that is small enough is taken. */
const QUALITIES = [0.75, 0.5, 0.25];
/** The view has much air around what it shows. */
const CLOSER = 1.5;

/** Pictures by document, as data addresses; empty where there is none. */
export const useThumbnails = create<Record<string, string>>(() => ({}));

/** Take a picture of what is open and keep it, also when that is closed meanwhile. */
export async function keepThumbnail(): Promise<void> {
  const document = openId(now());
  const blob = barred(now(), "SaveProject") || !serves("SetViewState") ? null : await theEngine()?.picture();
  if (!blob) return;
  const thumbnail = await smaller(blob);
  if (!thumbnail) return;
  if (!useOwn.getState()[document]) useThumbnails.setState({ [document]: thumbnail });
  await call("SetViewState", { scope: "shared", document, values: { thumbnail } });
}

/** Of which documents the picture is somebody's own, which saving does not replace. */
export const useOwn = create<Record<string, boolean>>(() => ({}));

/** Keep a picture of the user's own for a document, for all; null: that of the view again. Gives why not. */
export function keepOwnPicture(document: string, file: Blob | null): Promise<string> {
  return refusal(async () => {
    const picture = file && (await smaller(file, 1));
    if (picture === "") throw new Error(t`The picture is too large.`);
    await call("SetViewState", { scope: "shared", document, values: { picture } });
    await readThumbnail(document);
  });
}

/** Ask for the picture of a document. */
export async function readThumbnail(document: string): Promise<void> {
  if (!serves("GetViewState")) return;
  const { values } = await call("GetViewState", { scope: "shared", document });
  const { thumbnail, picture } = values as { thumbnail?: unknown; picture?: unknown };
  const [own, taken] = [picture, thumbnail].map((each) =>
    typeof each === "string" && each.startsWith("data:image/") ? each : "",
  );
  useOwn.setState({ [document]: !!own });
  useThumbnails.setState({ [document]: own || taken || "" });
}

/** The middle of a picture, as wide as a tile; empty when it stays too large. Rejects when it is none. */
async function smaller(blob: Blob, closer = CLOSER): Promise<string> {
  const picture = await createImageBitmap(blob).catch(() => {
    throw new Error(t`The browser cannot read this picture file.`);
  });
  const canvas = globalThis.document.createElement("canvas");
  canvas.width = WIDTH;
  canvas.height = HEIGHT;
  const scale = Math.max(WIDTH / picture.width, HEIGHT / picture.height) * closer;
  const [w, h] = [WIDTH / scale, HEIGHT / scale];
  canvas
    .getContext("2d")
    ?.drawImage(picture, (picture.width - w) / 2, (picture.height - h) / 2, w, h, 0, 0, WIDTH, HEIGHT);
  picture.close();
  return QUALITIES.map((each) => canvas.toDataURL("image/webp", each)).find((each) => each.length <= MOST) ?? "";
}
