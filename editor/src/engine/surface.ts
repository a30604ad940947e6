/** Materials of solid items, and the quality at which they are drawn. */

import { MeshLambertMaterial, type MeshLambertMaterialParameters } from "three";

/** How much the view costs to draw: "low" is for machines without a graphics processor. */
export type Quality = "low" | "high";

/** What draws cheaply, loaded at low quality only. */
export type LowQuality = typeof import("./baked");

/** Return a diffuse material with a colour that can be changed. */
export function surface(
  { low }: { low: LowQuality | null },
  parameters: MeshLambertMaterialParameters = {},
): MeshLambertMaterial {
  const material = new MeshLambertMaterial(parameters);
  low?.cheapen(material);
  return material;
}
