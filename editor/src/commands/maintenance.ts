/** Device cards: identities, and backups of parameters. */

import { t } from "@lingui/core/macro";
import { compareTexts } from "../formats";
import type { DeviceCard, Identity, ParameterBackup } from "../protocol/types";
import { call } from "../session/connection";
import { saveAs } from "./files";

export type IdentityField = keyof Identity;
export const IDENTITY_FIELDS: readonly IdentityField[] = ["vendor", "model", "serial", "firmware"];

/** Return whether a device is another unit, not the same one with another firmware. */
export const isOtherUnit = ({ differing }: Pick<DeviceCard, "differing">): boolean =>
  differing.some((each) => each !== "firmware");

/** Return how the connected device differs from the confirmed one; an empty string if it does not. */
export function differenceOf({ identity, found, differing }: DeviceCard): string {
  if (!found) return "";
  const model = found.model || identity.model;
  if (differing.includes("model")) return t`This is a different device: ${found.model} instead of ${identity.model}.`;
  if (differing.includes("serial"))
    return t`This is a different ${model}: serial number ${found.serial} instead of ${identity.serial}.`;
  if (differing.includes("firmware"))
    return t`This device has another firmware: ${found.firmware} instead of ${identity.firmware}.`;
  return t`This device is of another manufacturer: ${found.vendor} instead of ${identity.vendor}.`;
}

/** Sort cards: devices that need a technician first, then by name. */
export const sortedCards = (cards: readonly DeviceCard[]): DeviceCard[] =>
  [...cards].sort(
    (a, b) => Number(b.found !== undefined) - Number(a.found !== undefined) || compareTexts(a.name, b.name),
  );

/** Save a backup as a file on this device. */
export async function downloadBackup({ object_id, name }: DeviceCard, backup_id: string): Promise<void> {
  const backup = await call("GetParameterBackup", { object_id, backup_id });
  const content = new Blob([JSON.stringify(backup, null, 2)], { type: "application/json" });
  saveAs(content, `${name}-${backup.identity.serial || backup.object_type}-${backup.at.slice(0, 10)}.json`);
}

/** Store a backup from a file. */
export async function uploadBackup(object_id: string, file: File): Promise<void> {
  let backup: ParameterBackup;
  try {
    backup = JSON.parse(await file.text()) as ParameterBackup;
  } catch {
    throw new Error(t`${file.name} is not a backup of parameters.`);
  }
  await call("PutParameterBackup", { object_id, backup });
}
