/** A small picture of the workplace, kept with it for all: taken from the view when it is saved. */

import { theEngine } from "../session/engine";
import { openId } from "../store/selectors";
import { now } from "../store/store";
import { barred } from "./asking";
import { keepView } from "./viewstate";

/** px, and how many signs it may have at most. */
const WIDTH = 320;
const HEIGHT = 180;
const MOST = 48_000;
/** The view has much air around what it shows. */
const CLOSER = 1.5;

export async function keepThumbnail(): Promise<void> {
  const id = openId(now());
  const blob = barred(now(), "SaveProject") ? null : await theEngine()?.picture();
  if (!blob || openId(now()) !== id) return;
  const picture = await createImageBitmap(blob);
  const canvas = document.createElement("canvas");
  canvas.width = WIDTH;
  canvas.height = HEIGHT;
  // The middle of it, as wide as the tile.
  const scale = Math.max(WIDTH / picture.width, HEIGHT / picture.height) * CLOSER;
  const [w, h] = [WIDTH / scale, HEIGHT / scale];
  canvas.getContext("2d")?.drawImage(picture, (picture.width - w) / 2, (picture.height - h) / 2, w, h, 0, 0, WIDTH, HEIGHT);
  picture.close();
  const thumbnail = canvas.toDataURL("image/webp", 0.75);
  if (thumbnail.length < MOST) keepView("shared", { thumbnail });
}
