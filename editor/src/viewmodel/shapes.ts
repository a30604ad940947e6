/** Shapes of object types, as the 3D view draws them. */

import type { Shape } from "../engine/items";
import type { ObjectTypeMeta } from "../protocol/types";

/** Setting of conveyors, whose icon is that of all machines. */
const BELT_SETTING = "belt_speed";

export function shapeOf(type: Partial<ObjectTypeMeta> | undefined): Shape {
  const model = type?.object_model;
  if (model?.box) return { kind: "box", size: [model.box.size_x, model.box.size_y, model.box.size_z] };
  if (model?.cylinder) return { kind: "cylinder", radius: model.cylinder.radius, height: model.cylinder.height };
  if (model?.sphere) return { kind: "sphere", radius: model.sphere.radius };
  if (model?.mesh) return { kind: "mesh", asset: model.mesh.asset_id };
  if (type?.settings?.some(({ name }) => name === BELT_SETTING)) return { kind: "none", icon: "axis" };
  return type?.icon ? { kind: "none", icon: type.icon } : { kind: "none" };
}
