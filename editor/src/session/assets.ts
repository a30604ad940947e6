/** Assets of the server: meshes and robot models. */

import { t } from "@lingui/core/macro";
import { FILE_DEADLINE, rest } from "./rest";

/** Return an asset as binary glTF, prepared by the server; reject with the server's sentence. */
export async function readShown(id: string): Promise<ArrayBuffer> {
  const failure = t`The mesh ${id} cannot be loaded`;
  const path = `/api/assets/${encodeURIComponent(id)}/shown`;
  return (await rest(path, { failure, deadline: FILE_DEADLINE })).arrayBuffer();
}

/** Upload a file as a new asset and return its id. Reject with a sentence. */
export async function uploadAsset(file: File): Promise<string> {
  const body = new FormData();
  body.append("assetData", file);
  const failure = t`The server refused ${file.name}`;
  const response = await rest("/assets", { method: "POST", body, failure, deadline: FILE_DEADLINE });
  return ((await response.json()) as { id: string }).id;
}
