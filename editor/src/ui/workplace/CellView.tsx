/**
 * A picture of the cell with its moving robots: the 3D view without controls, fitted to the devices. It is part of the
 * shell, because it shares its modules; the operator screen gets it from there.
 */

import { t } from "@lingui/core/macro";
import type { Engine } from "../../engine/engine";
import type { Item } from "../../engine/items";
import { useEngine } from "./useEngine";

const USE = {
  shown: ({ kind }: Item) => kind === "robot" || kind === "object",
  begin: (engine: Engine) => {
    engine.view.enable(false); // the page scrolls instead
    return () => {};
  },
};

export function CellView() {
  const { canvas, labels, failed, quality } = useEngine(USE);
  if (failed) return null; // the screen is complete without the picture
  return (
    <section className="view operator-cell" aria-label={t`The cell`}>
      <canvas ref={canvas} key={quality} role="img" aria-label={t`3D picture of the cell`} />
      <div ref={labels} className="view-labels" aria-hidden="true" />
    </section>
  );
}
