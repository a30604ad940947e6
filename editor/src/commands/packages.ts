/** Import and export of packages. */

import { t } from "@lingui/core/macro";
import { freeName } from "../program/naming";
import { FILE_DEADLINE, rest } from "../session/rest";
import { getState } from "../store/store";
import { saveAs } from "./files";
import { refusal } from "./requests";

/** Import a package with a new id. Return why it failed, or an empty string. */
export function uploadPackage(file: File): Promise<string> {
  return refusal(async () => {
    const base = file.name.replace(/\.zip$/i, "").replace(/[^\w-]+/g, "_") || "package";
    const taken = getState().lists.packages?.map((each) => each.id) ?? [];
    const id = freeName(base, taken);
    const body = new FormData();
    body.append("executionPackage", file);
    const failure = t`The server refused ${file.name}`;
    await rest(`/packages/${encodeURIComponent(id)}`, { method: "POST", body, failure, deadline: FILE_DEADLINE });
  });
}

/** Save a package as a file on this device. Return why it failed, or an empty string. */
export function downloadPackage(id: string, name: string): Promise<string> {
  return refusal(async () => {
    const failure = t`${name} cannot be downloaded`;
    const response = await rest(`/packages/${encodeURIComponent(id)}`, { failure, deadline: FILE_DEADLINE });
    saveAs(await response.blob(), `${name.replace(/[^\w-]+/g, "_")}.zip`);
  });
}
