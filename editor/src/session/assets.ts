/** Assets of the server: meshes and robot models. */

import { t } from "@lingui/core/macro";
import { type ServerMessage, translate } from "../i18n/serverMessages";
import { remembered } from "./localStorage";

/** Return an asset as binary glTF, prepared by the server; reject with the server's sentence. */
export async function readShown(id: string): Promise<ArrayBuffer> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/api/assets/${encodeURIComponent(id)}/shown`, { headers });
  if (!response.ok) throw new Error(await refusedWith(response, t`The mesh ${id} cannot be loaded`));
  return response.arrayBuffer();
}

/** Upload a file as a new asset and return its id. Reject with a sentence. */
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

/** Return the reason given by the server, or a general one. */
export async function refusedWith(response: Response, otherwise: string): Promise<string> {
  const body = (await response.json().catch(() => ({}))) as Omit<ServerMessage, "text"> & { message?: string };
  return body.message === undefined ? `${otherwise} (${response.status}).` : translate({ ...body, text: body.message });
}
