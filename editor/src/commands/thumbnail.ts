/** A thumbnail of the workplace for all users: taken from the view when the document is saved, shown on its tile. */

import { t } from "@lingui/core/macro";
import { call, serves } from "../session/connection";
import { put } from "../store/records";
import type { Thumbnail } from "../store/state";
import { getState, store } from "../store/store";
import { refusal } from "./requests";

/** Size in pixels, and largest number of characters. */
const WIDTH = 320;
const HEIGHT = 180;
const MOST = 48_000;
/** Qualities in the order in which they are tried. */
const QUALITIES = [0.75, 0.5, 0.25];
/** Part of the view that is cut out, since its borders are mostly empty. */
const CLOSER = 1.5;

function setThumbnail(document: string, thumbnail: Thumbnail): void {
  store.setState(({ thumbnails }) => ({ thumbnails: put(thumbnails, document, thumbnail) }));
}

/** Store a picture of the view as the thumbnail of a document, even if the document is then closed. */
export async function storeThumbnail(document: string, picture: Promise<Blob | null>): Promise<void> {
  const blob = serves("SetViewState") ? await picture : null;
  if (!blob) return;
  const thumbnail = await smaller(blob);
  if (!thumbnail) return;
  if (!getState().thumbnails[document]?.own) setThumbnail(document, { picture: thumbnail, own: false });
  await call("SetViewState", { scope: "shared", document, values: { thumbnail } });
}

/** Store a picture chosen by the user for a document; null: use the view again. Return why it failed. */
export function storeOwnPicture(document: string, file: Blob | null): Promise<string> {
  return refusal(async () => {
    const picture = file && (await smaller(file, 1));
    if (picture === "") throw new Error(t`The picture is too large.`);
    await call("SetViewState", { scope: "shared", document, values: { picture } });
    await loadThumbnail(document);
  });
}

/** Request the thumbnail of a document that was saved at `time`, unless it was requested before. */
export function loadThumbnailOnce(document: string, time: string): void {
  const { thumbnailTimes } = getState().runtime;
  if (thumbnailTimes.get(document) === time) return;
  thumbnailTimes.set(document, time);
  // The tile shows the old picture, or none.
  loadThumbnail(document).catch(() => thumbnailTimes.delete(document));
}

async function loadThumbnail(document: string): Promise<void> {
  if (!serves("GetViewState")) return;
  const before = getState().thumbnails[document];
  const { values } = await call("GetViewState", { scope: "shared", document });
  const { thumbnail, picture } = values as { thumbnail?: unknown; picture?: unknown };
  const [own, taken] = [picture, thumbnail].map((each) =>
    typeof each === "string" && each.startsWith("data:image/") ? each : "",
  );
  const known = getState().thumbnails[document];
  // After a quick close, the thumbnail of the save may be taken, or be under way to the server, before this answer.
  if (!own && !taken && (known !== before || (known && !known.own))) return;
  setThumbnail(document, { picture: own || taken || "", own: !!own });
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
