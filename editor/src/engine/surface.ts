/** Materials of solid items, and the quality at which they are drawn. */

import { MeshLambertMaterial, type MeshLambertMaterialParameters } from "three";

/** The quality of the view: "low" is for machines without a graphics processor. */
export type Quality = "low" | "high";

/** The module that draws at low quality, loaded only if needed. */
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
