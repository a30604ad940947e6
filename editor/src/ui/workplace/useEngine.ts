/** The engine of a view: loaded when it is needed, and shows the items of the state until the view is closed. */

import { i18n } from "@lingui/core";
import { type RefObject, useEffect, useRef, useState } from "react";
import type { Engine, Quality } from "../../engine/engine";
import type { Item } from "../../engine/items";
import { persistently } from "../../persistently";
import { readShown } from "../../session/assets";
import { setEngine } from "../../session/engine";
import { getState, notify, store, useEditor } from "../../store/store";
import { telemetry } from "../../store/telemetry";
import { ItemMaker } from "../../viewmodel/items";
import { useTheme } from "../settings/Settings";

/** The items that a view shows, and the function that starts to use its engine and returns one that stops it. */
interface EngineUse {
  shown?: (item: Item) => boolean;
  begin: (engine: Engine, canvas: HTMLCanvasElement) => () => void;
}

interface UsedEngine {
  canvas: RefObject<HTMLCanvasElement | null>;
  labels: RefObject<HTMLDivElement | null>;
  engine: Engine | null;
  /** The reason why the engine does not work; empty if it works. */
  failed: string;
  /** Quality set by the user, the key of the canvas. */
  quality: string;
}

/** `use` must be a constant. */
export function useEngine({ shown, begin }: EngineUse): UsedEngine {
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
    const start = async () => {
      const [{ Engine }, low] = await Promise.all([
        persistently(() => import("../../engine/engine")),
        chosen(quality) === "low" ? persistently(() => import("../../engine/baked")) : null,
      ]);
      if (ended || !canvas.current || !labels.current) return;
      const view = new Engine({
        canvas: canvas.current,
        labels: labels.current,
        telemetry,
        asset: readShown,
        reportFault: once,
        low,
        dark: themeAtStart.current === "dark",
      });
      made = view;
      const show = (state = getState()) => {
        const items = maker.items(state);
        view.show(shown ? items.filter(shown) : items);
      };
      show();
      view.focus(undefined, true);
      const end = begin(view, canvas.current);
      const unsubscribe = store.subscribe((state, before) => {
        show(state);
        if (state.doc && state.doc.scene.id !== before.doc?.scene.id) view.focus(undefined, true);
      });
      // The labels contain words.
      const unlisten = i18n.on("change", () => {
        maker = new ItemMaker();
        show();
      });
      stop = () => {
        end();
        unsubscribe();
        unlisten();
      };
      setEngine(view);
      setMine(view);
    };
    start().catch((error: unknown) => setFailed(error instanceof Error ? error.message : String(error)));
    return () => {
      ended = true;
      stop();
      setEngine(null);
      setMine(null);
      made?.dispose();
    };
  }, [quality, shown, begin]);

  useEffect(() => {
    themeAtStart.current = theme;
    engine?.setDark(theme === "dark");
  }, [engine, theme]);

  return { canvas, labels, engine, failed, quality };
}

/** `?q=low` and `?q=high` select the quality; by default devices with few cores get the low one. */
function chosen(quality: "auto" | Quality): Quality {
  if (quality !== "auto") return quality;
  const asked = new URLSearchParams(location.search).get("q");
  if (asked === "low" || asked === "high") return asked;
  return navigator.hardwareConcurrency <= 4 ? "low" : "high";
}
