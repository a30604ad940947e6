/** A thumbnail of the workplace for all users: taken from the view when the document is saved, shown on its tile. */

import { t } from "@lingui/core/macro";
import { create } from "zustand";
import { call, serves } from "../session/connection";
import { theEngine } from "../session/engine";
import { whyUnavailable } from "../store/permissions";
import { openId } from "../store/selectors";
import { now } from "../store/store";
import { refusal } from "./requests";

/** Size in pixels, and largest number of characters. */
const WIDTH = 320;
const HEIGHT = 180;
const MOST = 48_000;
/** Qualities in the order in which they are tried. */
const QUALITIES = [0.75, 0.5, 0.25];
/** Part of the view that is cut out, since its borders are mostly empty. */
const CLOSER = 1.5;

/** Thumbnails by document, as data URLs; empty if there is none. */
export const useThumbnails = create<Record<string, string>>(() => ({}));

/** Take a thumbnail of the open document and store it, even if the document is closed meanwhile. */
export async function keepThumbnail(): Promise<void> {
  const document = openId(now());
  const blob = whyUnavailable(now(), "SaveProject") || !serves("SetViewState") ? null : await theEngine()?.picture();
  if (!blob) return;
  const thumbnail = await smaller(blob);
  if (!thumbnail) return;
  if (!useOwn.getState()[document]) useThumbnails.setState({ [document]: thumbnail });
  await call("SetViewState", { scope: "shared", document, values: { thumbnail } });
}

/** Documents with a picture chosen by a user, which saving does not replace. */
export const useOwn = create<Record<string, boolean>>(() => ({}));

/** Store a picture chosen by the user for a document; null: use the view again. Return why it failed. */
export function keepOwnPicture(document: string, file: Blob | null): Promise<string> {
  return refusal(async () => {
    const picture = file && (await smaller(file, 1));
    if (picture === "") throw new Error(t`The picture is too large.`);
    await call("SetViewState", { scope: "shared", document, values: { picture } });
    await readThumbnail(document);
  });
}

/** Request the thumbnail of a document. */
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

/**
 * Return the middle of a picture in the format of a tile; empty if it stays too large. Reject if it is not a picture.
 */
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
