/** The 3D view of the workplace: handles taps, and follows the running action. */

import { t } from "@lingui/core/macro";
import { Suspense } from "react";
import type { Engine } from "../../engine/engine";
import { persistently } from "../../persistently";
import { handleTap } from "../../session/taps";
import { store } from "../../store/store";
import { Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { pick } from "./pick";
import { useEngine } from "./useEngine";

const ViewControls = lazyComponent(() => import("../view/ViewControls"));

const USE = {
  begin: (engine: Engine, canvas: HTMLCanvasElement) => {
    engine.onTap = (hits, floor) => {
      if (!handleTap(hits, floor)) pick(hits.map((hit) => hit.id));
    };
    let ended = false;
    let noDrags = () => {};
    void persistently(() => import("./dragPucks")).then(({ dragPucks }) => {
      if (!ended) noDrags = dragPucks(engine, canvas);
    });
    const unsubscribe = store.subscribe((state, before) => {
      const at = state.program.running.at(-1);
      if (state.ui.follow && at !== undefined && at !== before.program.running.at(-1)) engine.focus(at);
    });
    return () => {
      ended = true;
      noDrags();
      unsubscribe();
    };
  },
};

export function View3D() {
  const { canvas, labels, engine, failed, quality } = useEngine(USE);
  return (
    <main className="view">
      <canvas
        ref={canvas}
        key={quality}
        tabIndex={0}
        role="application"
        aria-label={t`3D view. Keys W, A, S, D, Q and E fly. The object list offers the same by keyboard.`}
      />
      <div ref={labels} className="view-labels" aria-hidden="true" />
      {!engine && !failed && <Waiting>{t`Loading the view…`}</Waiting>}
      {failed && (
        <p className="view-failed" role="alert">
          {t`The 3D view does not work on this device: ${failed} You can still use the lists and panels.`}
        </p>
      )}
      {engine && (
        <Suspense fallback={null}>
          <ViewControls engine={engine} />
        </Suspense>
      )}
    </main>
  );
}
