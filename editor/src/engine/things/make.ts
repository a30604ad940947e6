/** Create the model of an item. */

import type { Item } from "../items";
import type { Context, Thing } from "../thing";
import { LinkThing } from "./link";
import { ObjectThing } from "./object";
import { OrientationThing } from "./orientation";
import { PointThing } from "./point";
import { PuckThing } from "./puck";
import { RobotThing } from "./robot";

export function make(item: Item, context: Context): Thing {
  switch (item.kind) {
    case "object":
      return new ObjectThing(item, context) as Thing;
    case "robot":
      return new RobotThing(item, context) as Thing;
    case "point":
      return new PointThing(item, context) as Thing;
    case "orientation":
      return new OrientationThing(item, context) as Thing;
    case "action":
      return new PuckThing(item, context) as Thing;
    case "logic":
      return new LinkThing(item, context) as Thing;
  }
}
