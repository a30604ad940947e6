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
