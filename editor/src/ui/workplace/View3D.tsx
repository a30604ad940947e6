/** The 3D view: passes the items to the engine, and handles taps. The engine is loaded when it is needed. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { Suspense, useEffect, useRef, useState } from "react";
import type { Engine, Quality } from "../../engine/engine";
import { readShown } from "../../session/assets";
import { setEngine } from "../../session/engine";
import { tapTaken } from "../../session/taps";
import { notify, now, store, useEditor } from "../../store/store";
import { telemetry } from "../../store/telemetry";
import { ItemMaker } from "../../viewmodel/items";
import { Waiting } from "../kit/kit";
import { lazyComponent, persistently } from "../kit/lazy";
import { useTheme } from "../settings/Settings";
import { pick } from "./pick";

const ViewControls = lazyComponent(() => import("../view/ViewControls"));

export function View3D() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const labels = useRef<HTMLDivElement>(null);
  const [engine, setMine] = useState<Engine | null>(null);
  const [failed, setFailed] = useState("");
  const theme = useTheme();
  const quality = useEditor((state) => state.ui.quality);
  const themeAtStart = useRef(theme);

  useEffect(() => {
    let ended = false;
    let made: Engine | null = null;
    let maker = new ItemMaker();
    const reportedFaults = new Set<string>();
    const once = (sentence: string) => {
      if (!reportedFaults.has(sentence)) notify("error", sentence);
      reportedFaults.add(sentence);
    };
    let stop = () => {};
    const begin = async () => {
      const { Engine } = await persistently(() => import("../../engine/engine"));
      if (ended || !canvas.current || !labels.current) return;
      made = new Engine({
        canvas: canvas.current,
        labels: labels.current,
        telemetry,
        asset: readShown,
        reportFault: once,
        quality: chosen(quality),
        dark: themeAtStart.current === "dark",
      });
      const shown = made;
      shown.onTap = (hits, floor) => {
        if (!tapTaken(hits, floor)) pick(hits.map((hit) => hit.id));
      };
      shown.show(maker.items(now()));
      shown.focus(undefined, true);
      let noDrags = () => {};
      const pane = canvas.current;
      void persistently(() => import("./dragPucks")).then(({ dragPucks }) => {
        if (!ended) noDrags = dragPucks(shown, pane);
      });
      const unsubscribe = store.subscribe((state, before) => {
        shown.show(maker.items(state));
        if (state.doc && state.doc.scene.id !== before.doc?.scene.id) shown.focus(undefined, true);
        const at = state.program.running.at(-1);
        if (state.ui.follow && at !== undefined && at !== before.program.running.at(-1)) shown.focus(at);
      });
      // The labels contain words.
      const unlisten = i18n.on("change", () => {
        maker = new ItemMaker();
        shown.show(maker.items(now()));
      });
      stop = () => {
        noDrags();
        unsubscribe();
        unlisten();
      };
      setEngine(shown);
      setMine(shown);
    };
    begin().catch((error: unknown) => setFailed(error instanceof Error ? error.message : String(error)));
    return () => {
      ended = true;
      stop();
      setEngine(null);
      setMine(null);
      made?.dispose();
    };
  }, [quality]);

  useEffect(() => {
    themeAtStart.current = theme;
    engine?.setDark(theme === "dark");
  }, [engine, theme]);

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

/** `?q=low` and `?q=high` select the quality; by default devices with few cores get the low one. */
function chosen(quality: "auto" | Quality): Quality {
  if (quality !== "auto") return quality;
  const asked = new URLSearchParams(location.search).get("q");
  if (asked === "low" || asked === "high") return asked;
  return navigator.hardwareConcurrency <= 4 ? "low" : "high";
}
