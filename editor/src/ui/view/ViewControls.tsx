/** Controls of the view: show all, view cube, fly or orbit, saved views. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { Suspense, useEffect, useRef, useState } from "react";
import { followItemRequests } from "../../commands/handover";
import { storeGeneralState, storeViewState } from "../../commands/viewstate";
import type { ViewMode, ViewName, Viewpoint } from "../../engine/camera";
import type { Engine } from "../../engine/engine";
import { calledBy } from "../../program/operands";
import { aimsAlways } from "../../session/aiming";
import { getState, useEditor } from "../../store/store";
import { viewersOf } from "../../viewmodel/viewers";
import { Aim } from "../aim/Aim";
import { OffScreen } from "../aim/OffScreen";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { AskName, More } from "../kit/lazyControls";
import type { Choice } from "../kit/props";
import { isTyping } from "../search/overlay";
import { Clusters } from "./Clusters";
import { FlyPad } from "./FlyPad";
import { type Direction, SIDES } from "./sides";
import "../aim/aim.css";
import "./view.css";

const StartAr = lazyComponent(() => import("../ar/StartAr"));
const ArView = lazyComponent(() => import("../ar/ArView"));
const ArUsers = lazyComponent(() => import("../ar/ArUsers"));

const PuckValues = lazyComponent(() => import("../program/PuckValues"));

/** Half edge, pixels. */
const HALF = 30;

const KEY = "bookmarks";
const Insets = lazyComponent(() => import("./Insets"));

interface Bookmark extends Viewpoint {
  name: string;
}

function bookmarksOf(stored: unknown): Bookmark[] {
  if (!Array.isArray(stored)) return [];
  const triple = (value: unknown) =>
    Array.isArray(value) &&
    value.length === 3 &&
    value.every((each) => typeof each === "number" && Number.isFinite(each));
  return stored.filter(
    (each: Partial<Bookmark> | null): each is Bookmark =>
      typeof each?.name === "string" && triple(each.position) && triple(each.target),
  );
}

export default function ViewControls({ engine }: { engine: Engine }) {
  const stored = useEditor((state) => state.view.user[KEY]);
  const [mode, setMode] = useState<ViewMode>("orbit");
  const [naming, setNaming] = useState(false);
  const [insets, setInsets] = useState(false);
  const bookmarks = bookmarksOf(stored);
  const always = useEditor(aimsAlways);
  const listed = useEditor((state) => state.ui.crosshair.listed);
  const ar = useEditor((state) => state.ui.ar !== null);
  const called = useEditor(({ doc, ui }) => doc !== null && calledBy(doc, doc.actions[ui.selection?.id ?? ""]) != null);
  const others = useEditor((state) => viewersOf(state).length > 0);
  const [starting, setStarting] = useState(false);
  useCrosshairKey();
  useEffect(followItemRequests, []);
  const change = (next: ViewMode) => {
    engine.view.setMode(next);
    setMode(next);
  };
  const look = (from: ViewName) => {
    engine.view.lookFrom(from);
    setMode("orbit");
  };
  const choices: Choice[] = [
    { id: "home", label: t`View: corner`, act: () => look("home") },
    ...SIDES.map(([id, words]) => ({ id, label: t`View: ${i18n._(words)}`, act: () => look(id) })),
    mode === "orbit"
      ? { id: "fly", label: t`Fly mode`, icon: "play" as const, act: () => change("fly") }
      : { id: "orbit", label: t`Orbit mode`, icon: "redo" as const, act: () => change("orbit") },
    {
      id: "cross",
      label: always ? t`Close the crosshair` : t`Select with crosshair ( X )`,
      icon: "point",
      act: switchCrosshair,
    },
    {
      id: "insets",
      label: insets ? t`Close top and side views` : t`Top and side views`,
      icon: "eye",
      act: () => setInsets(!insets),
    },
    { id: "keep", label: t`Save view…`, icon: "plus", act: () => setNaming(true) },
    ...bookmarks.map((each, n) => ({
      id: `go ${n}`,
      label: each.name,
      act: () => {
        change("orbit");
        engine.view.set(each.position, each.target);
      },
    })),
    ...bookmarks.map((each, n) => ({
      id: `drop ${n}`,
      label: t`Delete ${each.name}`,
      icon: "close" as const,
      act: () => storeViewState("user", { [KEY]: bookmarks.filter((_, other) => other !== n) }),
    })),
  ];
  return (
    <>
      {!ar && (
        <div className="view-controls">
          <Button icon="zoom" aria-label={t`Show all`} onPress={() => engine.focus()} />
          <Cube engine={engine} onLook={look} />
          <More label={t`Views`} icon="eye" variant="" choices={choices} />
          <Button icon="camera" onPress={() => setStarting(true)}>
            {t`AR`}
          </Button>
        </div>
      )}
      <Suspense fallback={null}>
        {called && <PuckValues engine={engine} />}
        {starting && <StartAr onClose={() => setStarting(false)} />}
        {ar && <ArView engine={engine} />}
        {others && <ArUsers engine={engine} />}
      </Suspense>
      {(always || listed || ar) && <Aim engine={engine} />}
      <OffScreen engine={engine} />
      <Clusters engine={engine} />
      {insets && !ar && (
        <Suspense fallback={null}>
          <Insets engine={engine} onLook={look} onClose={() => setInsets(false)} />
        </Suspense>
      )}
      {mode === "fly" && !ar && <FlyPad view={engine.view} onDone={() => change("orbit")} />}
      {naming && (
        <AskName
          title={t`Save view`}
          confirmLabel={t`Save`}
          initial={t`View ${bookmarks.length + 1}`}
          taken={bookmarks.map((each) => each.name)}
          onClose={() => setNaming(false)}
          onConfirm={(name) => storeViewState("user", { [KEY]: [...bookmarks, { name, ...engine.view.viewpoint }] })}
        />
      )}
    </>
  );
}

function switchCrosshair(): void {
  storeGeneralState({ aiming: !aimsAlways(getState()) || null });
}

/** X shows or hides the crosshair. */
function useCrosshairKey(): void {
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      if (event.key.toLowerCase() !== "x" || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
      if (isTyping(event.target) || document.querySelector(".overlay")) return;
      switchCrosshair();
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
}

/**
 * A view cube: tap a face to look from there. The menu offers the same by keyboard. The faces are 2D transforms, since
 * a 3D element would be composited again with every change of the page.
 */
function Cube({ engine, onLook }: { engine: Engine; onLook: (from: ViewName) => void }) {
  const cube = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const turn = () => {
      const e = engine.view.camera.matrixWorldInverse.elements;
      // Return the components of a direction: right, down and towards the camera.
      const along = (row: number, [x, y, z]: Direction) =>
        (e[row] ?? 0) * x + (e[4 + row] ?? 0) * y + (e[8 + row] ?? 0) * z;
      SIDES.forEach(([, , faces, words, upper], n) => {
        const face = cube.current?.children[n] as HTMLElement | undefined;
        if (!face) return;
        const towards = along(2, faces) > 0.01;
        const parts = [
          along(0, words),
          -along(1, words),
          -along(0, upper),
          along(1, upper),
          HALF * along(0, faces),
          -HALF * along(1, faces),
        ];
        const transform = towards ? `matrix(${parts.map((each) => each.toFixed(3)).join()})` : "";
        if (face.style.transform === transform) return;
        face.style.transform = transform;
        face.style.display = towards ? "grid" : "none";
      });
    };
    turn();
    return engine.watch(turn);
  }, [engine]);
  return (
    <div className="view-cube" aria-hidden="true">
      <div ref={cube} className="view-cube-body">
        {SIDES.map(([id, words]) => (
          <div key={id} className="view-cube-face" onClick={() => onLook(id)}>
            {i18n._(words)}
          </div>
        ))}
      </div>
    </div>
  );
}
