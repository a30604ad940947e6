/** Assets of the server: meshes, models of robots. */

import { t } from "@lingui/core/macro";
import { remembered } from "./memory";

/** Give an asset as the server makes it ready to be shown, binary glTF; rejects with the server's sentence. */
export async function readShown(id: string): Promise<ArrayBuffer> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/api/assets/${encodeURIComponent(id)}/shown`, { headers });
  if (!response.ok) throw new Error(await refusedWith(response, t`The mesh ${id} cannot be loaded`));
  return response.arrayBuffer();
}

/** Take a file to the server as a new asset; gives its id. Rejects with a sentence. */
export async function uploadAsset(file: File): Promise<string> {
  const token = remembered("token");
  const body = new FormData();
  body.append("assetData", file);
  const response = await fetch("/assets", {
    method: "POST",
    body,
    headers: token ? { Authorization: `Bearer ${token}` } : {},
  });
  if (!response.ok) throw new Error(await refusedWith(response, t`The server refused ${file.name}`));
  return ((await response.json()) as { id: string }).id;
}

/** Why the server refused, by its own sentence where there is one. */
export async function refusedWith(response: Response, otherwise: string): Promise<string> {
  const { message } = (await response.json().catch(() => ({}))) as { message?: string };
  return message ?? `${otherwise} (${response.status}).`;
}
