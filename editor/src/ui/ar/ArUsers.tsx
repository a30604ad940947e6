/** The poses of other users in AR: a small camera with their name, in their colour. */

import { t } from "@lingui/core/macro";
import { useLayoutEffect, useRef } from "react";
import { Vector3 } from "three";
import type { Engine } from "../../engine/engine";
import { useEditor } from "../../store/store";
import { type Viewer, viewersOf } from "../../viewmodel/viewers";
import { colourOf } from "../people/colours";
import "./users.css";

/** Half width, half height and length of the drawn field of view, m. */
const [X, Y, Z] = [0.1, 0.065, 0.16];
const CORNERS = [
  [-X, -Y, Z],
  [X, -Y, Z],
  [X, Y, Z],
  [-X, Y, Z],
] as const;
/** The eye, the corners, and the tip of the triangle on the upper side. */
const POINTS = [[0, 0, 0], ...CORNERS, [0, -1.7 * Y, Z]] as const;
const STROKES = [
  [1, 2, 3, 4, 1],
  [1, 0, 2],
  [3, 0, 4],
  [1, 5, 2],
];

export default function ArUsers({ engine }: { engine: Engine }) {
  // Joined to a text: a selector has to return the same value for the same state.
  const shown = useEditor((state) => JSON.stringify(viewersOf(state)));
  const symbols = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    const viewers = JSON.parse(shown) as Viewer[];
    const place = () => viewers.forEach((each, n) => placeSymbol(symbols.current?.children[n], each, engine));
    place();
    return engine.watch(place);
  }, [engine, shown]);
  return (
    <div ref={symbols} className="ar-users">
      {(JSON.parse(shown) as Viewer[]).map(({ user }) => (
        <div key={user} style={{ color: colourOf(user) }}>
          <svg aria-hidden="true">
            <path className="ar-user-rim" />
            <path />
          </svg>
          <span className="ar-user" style={{ background: colourOf(user) }}>{t`${user} in AR`}</span>
        </div>
      ))}
    </div>
  );
}

/** Draw the field of view of a user's camera, or hide it if a part is behind the camera of the view. */
function placeSymbol(symbol: Element | undefined, { camera }: Viewer, engine: Engine): void {
  if (!(symbol instanceof HTMLElement)) return;
  const { width, height } = engine.shown();
  const seen = POINTS.map((point) => {
    const at = new Vector3(...point).applyQuaternion(camera.orientation as never).add(camera.position);
    return at.project(engine.view.camera);
  });
  symbol.hidden = seen.some(({ z }) => z > 1 || z < -1);
  if (symbol.hidden) return;
  const pixels = seen.map(({ x, y }) => [Math.round(((x + 1) / 2) * width), Math.round(((1 - y) / 2) * height)]);
  const path = STROKES.map((stroke) => `M${stroke.map((n) => pixels[n]?.join()).join("L")}`).join("");
  for (const each of symbol.querySelectorAll("path")) each.setAttribute("d", path);
  const label = symbol.lastElementChild as HTMLElement;
  const top = Math.min(...pixels.map(([, y]) => y as number));
  label.style.transform = `translate(${pixels[0]?.[0]}px, ${top - 6}px) translate(-50%, -100%)`;
}
