/** Reads assets as the server makes them ready to be shown: binary glTF, small and with normals. */

import { remembered } from "./memory";

/** Give an asset ready to be shown; rejects with the server's sentence. */
export async function readShown(id: string): Promise<ArrayBuffer> {
  const token = remembered("token");
  const headers: HeadersInit = token ? { Authorization: `Bearer ${token}` } : {};
  const response = await fetch(`/api/assets/${encodeURIComponent(id)}/shown`, { headers });
  if (response.ok) return response.arrayBuffer();
  const { message } = (await response.json().catch(() => ({}))) as { message?: string };
  throw new Error(message ?? `The server does not give the mesh ${id} (${response.status}).`);
}
