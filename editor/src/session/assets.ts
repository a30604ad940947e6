/** Reads assets of the server: meshes, models of robots. */

import { remembered } from "./memory";

/** Give an asset and its file name; rejects with a sentence. */
export async function readAsset(id: string): Promise<{ name: string; content: ArrayBuffer }> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/assets/${encodeURIComponent(id)}/data`, { headers });
  if (!response.ok) throw new Error(`The server does not give the asset ${id} (${response.status}).`);
  const name = /filename\*=UTF-8''([^;]+)/.exec(response.headers.get("Content-Disposition") ?? "")?.[1];
  return { name: name ? decodeURIComponent(name) : id, content: await response.arrayBuffer() };
}

/** Take a file to the server as a new asset; gives its id. Rejects with a sentence. */
export async function uploadAsset(file: File): Promise<string> {
  const token = remembered("token");
  const body = new FormData();
  body.append("assetData", file);
  const response = await fetch("/assets", { method: "POST", body, headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!response.ok) throw new Error(await refusedWith(response, `The server does not take ${file.name}`));
  return ((await response.json()) as { id: string }).id;
}

/** Why the server refused, by its own sentence where there is one. */
export async function refusedWith(response: Response, otherwise: string): Promise<string> {
  const { message } = (await response.json().catch(() => ({}))) as { message?: string };
  return message ?? `${otherwise} (${response.status}).`;
}
