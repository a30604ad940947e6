/** The outlines of the configured markers where they are expected, the corners as seen, and their errors. */

import { useEffect, useRef } from "react";
import type { Point } from "../../ar/geometry";
import { projected } from "../../ar/pose";
import { decimal } from "../../formats";
import { getState } from "../../store/store";

const SVG = "http://www.w3.org/2000/svg";

export function MarkerOutlines() {
  const drawing = useRef<SVGSVGElement>(null);
  useEffect(() => {
    const { ar } = getState().runtime;
    if (!ar) return;
    ar.onPicture = () => drawing.current && draw(drawing.current);
    ar.onPicture();
    return () => {
      ar.onPicture = () => {};
    };
  }, []);
  return <svg ref={drawing} className="ar-markers" aria-hidden="true" />;
}

function draw(into: SVGSVGElement): void {
  const session = getState().runtime.ar;
  if (!session?.shown) return;
  const { found, view, lens } = session.shown;
  const shown = (point: Point) => session.onScreen(point);
  const parts: SVGElement[] = [];
  const polygon = (corners: readonly Point[], className: string) => {
    const each = document.createElementNS(SVG, "polygon");
    each.setAttribute("points", corners.map((point) => shown(point).join()).join(" "));
    each.setAttribute("class", className);
    parts.push(each);
  };
  for (const { corners } of session.places.values()) {
    const expected = view ? corners.map((corner) => projected(corner, view, lens)) : [];
    if (expected.length > 0 && expected.every((each) => each !== null)) polygon(expected, "expected");
  }
  for (const { id, corners } of found.seen) {
    polygon(corners, found.registration?.contradicting.includes(id) ? "seen contradicting" : "seen");
    const [x, y] = shown(corners[0]);
    const words = document.createElementNS(SVG, "text");
    const error = found.errors.get(id);
    words.textContent = error === undefined ? `${id}` : `${id}: ${decimal(error, 2)} px`;
    words.setAttribute("x", `${x}`);
    words.setAttribute("y", `${y - 6}`);
    parts.push(words);
  }
  into.replaceChildren(...parts);
}
