/** Recipes and records of units. */

import { t } from "@lingui/core/macro";
import type { Recipe } from "../protocol/types";
import { FILE_DEADLINE, rest } from "../session/rest";
import { saveAs } from "./files";

/** Return the name of a revision. */
export const shownRecipe = ({ product, revision }: Pick<Recipe, "product" | "revision">): string =>
  t`${product}, revision ${revision}`;

/** Save the units with a serial number as CSV on this device. Reject with a sentence. */
export async function exportUnits(serial: string): Promise<void> {
  const query = new URLSearchParams({ serial, limit: "1000" });
  const failure = t`The records are not available`;
  const response = await rest(`/api/units/export?${query}`, { failure, deadline: FILE_DEADLINE });
  saveAs(await response.blob(), `units-${new Date().toISOString().slice(0, 10)}.csv`);
}
