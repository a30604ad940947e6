/** Import and export of packages. */

import { t } from "@lingui/core/macro";
import { refusedWith } from "../session/assets";
import { remembered } from "../session/localStorage";
import { now } from "../store/store";
import { saveAs } from "./files";
import { refusal } from "./requests";

const headers = (): HeadersInit => {
  const token = remembered("token");
  return token ? { Authorization: `Bearer ${token}` } : {};
};

/** Import a package with a new id. Return why it failed, or an empty string. */
export function uploadPackage(file: File): Promise<string> {
  return refusal(async () => {
    const base = file.name.replace(/\.zip$/i, "").replace(/[^\w-]+/g, "_") || "package";
    const taken = new Set(now().lists.packages?.map((each) => each.id));
    let id = base;
    for (let number = 2; taken.has(id); number++) id = `${base}_${number}`;
    const body = new FormData();
    body.append("executionPackage", file);
    const response = await fetch(`/packages/${encodeURIComponent(id)}`, { method: "POST", body, headers: headers() });
    if (!response.ok) throw new Error(await refusedWith(response, t`The server refused ${file.name}`));
  });
}

/** Save a package as a file on this device. Return why it failed, or an empty string. */
export function downloadPackage(id: string, name: string): Promise<string> {
  return refusal(async () => {
    const response = await fetch(`/packages/${encodeURIComponent(id)}`, { headers: headers() });
    if (!response.ok) throw new Error(await refusedWith(response, t`${name} cannot be downloaded`));
    saveAs(await response.blob(), `${name.replace(/[^\w-]+/g, "_")}.zip`);
  });
}
