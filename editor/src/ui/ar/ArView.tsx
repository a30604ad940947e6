/** The user interface of AR: controls on the page, or in space on a headset. */

import { Suspense, useLayoutEffect } from "react";
import { leaveAr } from "../../commands/ar";
import type { Engine } from "../../engine/engine";
import { useEditor } from "../../store/store";
import { lazyComponent } from "../kit/lazy";
import { useTicking } from "../times";

const ArControls = lazyComponent(() => import("./ArControls"));
const HeadsetPanel = lazyComponent(() => import("./HeadsetPanel"));

export default function ArView({ engine }: { engine: Engine }) {
  const ar = useEditor((state) => state.ui.ar);
  useTicking(1);
  // A layout effect leaves AR before the view is closed.
  useLayoutEffect(() => () => leaveAr(), []);
  if (!ar) return null;
  return (
    <Suspense fallback={null}>
      {ar.mode === "headset" ? <HeadsetPanel ar={ar} /> : <ArControls engine={engine} ar={ar} />}
    </Suspense>
  );
}
