/** Labels of clusters: far away, crowded objects have one label with their number; a tap zooms to them. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { Vector3 } from "three";
import { boxOf, type Cluster, clustersOf, type Spot } from "../../engine/clusters";
import type { Engine } from "../../engine/engine";
import { boundsOf, type Thing } from "../../engine/thing";
import { controlAreas } from "../aim/OffScreen";

/** Names in the label for screen readers. */
const MAX_NAMES = 6;
const at = new Vector3();

export function Clusters({ engine }: { engine: Engine }) {
  const [clusters, setClusters] = useState<Cluster[]>([]);
  useEffect(() => {
    const radii = new Radii();
    let shown = "";
    engine.arrangeBy((labels) => {
      const spots = spotsOf(engine, radii);
      const view = engine.view.element.getBoundingClientRect();
      const controls = controlAreas(view);
      const found = clustersOf(spots, view.width, view.height, controls);
      const next = JSON.stringify(found);
      if (next !== shown) setClusters(found);
      shown = next;
      const inside = new Set(found.flatMap(({ ids }) => ids));
      return [labels.filter(({ id }) => !inside.has(id)), [...controls, ...found.map(boxOf)]];
    });
    return () => engine.arrangeBy((labels) => [labels, []]);
  }, [engine]);
  return clusters.map((cluster) => {
    const names = cluster.ids.map((id) => engine.item(id)?.name).slice(0, MAX_NAMES);
    const count = plural(cluster.ids.length, { one: "# object", other: "# objects" });
    return (
      <button
        key={cluster.ids[0]}
        type="button"
        className="view-cluster"
        style={{ transform: `translate(${Math.round(boxOf(cluster).left)}px, ${Math.round(boxOf(cluster).top)}px)` }}
        aria-label={t`${count}: ${names.join(", ")}. Zoom in`}
        onClick={() => engine.focus(cluster.ids)}
      >
        {count}
      </button>
    );
  });
}

/** Objects and robots in the view that may be in a cluster: neither selected nor in need of attention. */
function spotsOf(engine: Engine, radii: Radii): Spot[] {
  const { things, width, height } = engine.shown();
  const { camera } = engine.view;
  const pixels = height / (2 * Math.tan((camera.fov * Math.PI) / 360));
  const found: Spot[] = [];
  for (const [id, thing] of things) {
    const { item } = thing;
    if (item.kind !== "object" && item.kind !== "robot") continue;
    if (item.faint > 0.5 || item.selected || thing.badge()) continue;
    const size = (2 * radii.of(thing) * pixels) / thing.anchor(at).distanceTo(camera.position);
    at.project(camera);
    if (at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1) continue;
    found.push({ id, size, x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height });
  }
  return found;
}

/** Radii of items, m. They change rarely, so each is measured again after some time only. */
class Radii {
  private readonly known = new WeakMap<Thing, { radius: number; until: number }>();

  of(thing: Thing): number {
    const time = performance.now();
    const known = this.known.get(thing);
    if (known && time < known.until) return known.radius;
    const radius = boundsOf(thing).getSize(new Vector3()).length() / 2;
    this.known.set(thing, { radius, until: time + 2000 });
    return radius;
  }
}
