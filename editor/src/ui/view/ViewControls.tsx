/** At the edge of the view: all of it, a cube to look from its sides, to fly or to turn, and views that were kept. */

import { useEffect, useRef, useState } from "react";
import type { ViewMode, ViewName, Viewpoint } from "../../engine/camera";
import type { Engine } from "../../engine/engine";
import { keepView } from "../../commands/viewstate";
import { useEditor } from "../../store/store";
import { AskName, Button, type Choice, More } from "../kit/kit";
import { FlyPad } from "./FlyPad";
import "./view.css";

const SIDES: [ViewName, string, string][] = [
  ["top", "Top", "translateZ(30px)"],
  ["front", "Front", "rotateX(-90deg) translateZ(30px)"],
  ["back", "Back", "rotateZ(180deg) rotateX(-90deg) translateZ(30px)"],
  ["side", "Right", "rotateZ(-90deg) rotateX(-90deg) translateZ(30px)"],
  ["left", "Left", "rotateZ(90deg) rotateX(-90deg) translateZ(30px)"],
];

const KEY = "bookmarks";

interface Bookmark extends Viewpoint {
  name: string;
}

function bookmarksOf(kept: unknown): Bookmark[] {
  if (!Array.isArray(kept)) return [];
  const triple = (value: unknown) => Array.isArray(value) && value.length === 3 && value.every((each) => typeof each === "number" && Number.isFinite(each));
  return kept.filter((each: Partial<Bookmark> | null): each is Bookmark => typeof each?.name === "string" && triple(each.position) && triple(each.target));
}

export default function ViewControls({ engine }: { engine: Engine }) {
  const kept = useEditor((state) => state.view.user[KEY]);
  const [mode, setMode] = useState<ViewMode>("orbit");
  const [naming, setNaming] = useState(false);
  const bookmarks = bookmarksOf(kept);
  const change = (next: ViewMode) => {
    engine.view.setMode(next);
    setMode(next);
  };
  const look = (from: ViewName) => {
    engine.view.look(from);
    setMode("orbit");
  };
  const choices: Choice[] = [
    { id: "home", label: "From the corner", act: () => look("home") },
    ...SIDES.map(([id, words]) => ({ id, label: `From ${words === "Top" ? "above" : `the ${words.toLowerCase()}`}`, act: () => look(id) })),
    mode === "orbit"
      ? { id: "fly", label: "Fly through it", icon: "play" as const, act: () => change("fly") }
      : { id: "orbit", label: "Turn around it", icon: "redo" as const, act: () => change("orbit") },
    { id: "keep", label: "Keep this view…", icon: "plus", act: () => setNaming(true) },
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
      label: `Forget ${each.name}`,
      icon: "close" as const,
      act: () => keepView("user", { [KEY]: bookmarks.filter((_, other) => other !== n) }),
    })),
  ];
  return (
    <>
      <div className="view-controls">
        <Button icon="zoom" aria-label="Show all" onPress={() => engine.focus()} />
        <Cube engine={engine} onLook={look} />
        <More label="Views" icon="eye" look="" choices={choices} />
      </div>
      {mode === "fly" && <FlyPad view={engine.view} onDone={() => change("orbit")} />}
      {naming && (
        <AskName
          title="Keep this view"
          yes="Keep"
          initial={`View ${bookmarks.length + 1}`}
          taken={bookmarks.map((each) => each.name)}
          onClose={() => setNaming(false)}
          onYes={(name) => keepView("user", { [KEY]: [...bookmarks, { name, ...engine.view.viewpoint }] })}
        />
      )}
    </>
  );
}

/** Turns as the view does; a tap on a face looks from there. The menu has the same for the keyboard. */
function Cube({ engine, onLook }: { engine: Engine; onLook: (from: ViewName) => void }) {
  const cube = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const turn = () => {
      // The camera's rotation the other way round; CSS has y downwards.
      const e = engine.view.camera.matrixWorldInverse.elements;
      const at = (row: number, column: number) => (e[column * 4 + row] ?? 0) * (row === 1 ? -1 : 1) * (column === 1 ? -1 : 1);
      const columns = [0, 1, 2].map((column) => `${at(0, column)},${at(1, column)},${at(2, column)},0`);
      if (cube.current) cube.current.style.transform = `matrix3d(${columns.join(",")},0,0,0,1)`;
    };
    engine.onFrame = turn;
    turn();
    return () => {
      engine.onFrame = () => {};
    };
  }, [engine]);
  return (
    <div className="view-cube" aria-hidden="true">
      <div ref={cube} className="view-cube-body">
        {SIDES.map(([id, words, place]) => (
          <div key={id} className="view-cube-face" style={{ transform: place }} onClick={() => onLook(id)}>
            {words}
          </div>
        ))}
      </div>
    </div>
  );
}
