/** A small picture of the workplace, kept with it for all: taken from the view when it is saved, shown on its tile. */

import { create } from "zustand";
import { theEngine } from "../session/engine";
import { call, serves } from "../session/session";
import { openId } from "../store/selectors";
import { now } from "../store/store";
import { barred } from "./asking";

/** px, and how many signs it may have at most. */
const WIDTH = 320;
const HEIGHT = 180;
const MOST = 48_000;
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
  if (thumbnail.length > MOST) return;
  useThumbnails.setState({ [document]: thumbnail });
  await call("SetViewState", { scope: "shared", document, values: { thumbnail } });
}

/** Ask for the picture of a document. */
export async function readThumbnail(document: string): Promise<void> {
  if (!serves("GetViewState")) return;
  const { values } = await call("GetViewState", { scope: "shared", document });
  const { thumbnail } = values as { thumbnail?: unknown };
  if (typeof thumbnail === "string" && thumbnail.startsWith("data:image/")) useThumbnails.setState({ [document]: thumbnail });
}

/** The middle of a picture, as wide as a tile. */
async function smaller(blob: Blob): Promise<string> {
  const picture = await createImageBitmap(blob);
  const canvas = globalThis.document.createElement("canvas");
  canvas.width = WIDTH;
  canvas.height = HEIGHT;
  const scale = Math.max(WIDTH / picture.width, HEIGHT / picture.height) * CLOSER;
  const [w, h] = [WIDTH / scale, HEIGHT / scale];
  canvas.getContext("2d")?.drawImage(picture, (picture.width - w) / 2, (picture.height - h) / 2, w, h, 0, 0, WIDTH, HEIGHT);
  picture.close();
  return canvas.toDataURL("image/webp", 0.75);
}
