/** Preview of a mesh before the upload, drawn once. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef } from "react";
import type { BufferGeometry } from "three";

/** Largest number of drawn triangles; of larger meshes every n-th is drawn. */
const MOST = 20_000;

export function MeshPreview({ geometry }: { geometry: BufferGeometry }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (context) draw(context, geometry);
  }, [geometry]);
  return (
    <canvas
      ref={canvas}
      width={600}
      height={320}
      className="mesh-preview"
      role="img"
      aria-label={t`Preview of the mesh`}
    />
  );
}

/** Axonometric drawing with the painter's algorithm; steep triangles are darker. */
function draw(context: CanvasRenderingContext2D, geometry: BufferGeometry): void {
  const { width, height } = context.canvas;
  context.clearRect(0, 0, width, height);
  const position = geometry.getAttribute("position");
  const { index } = geometry;
  const count = Math.floor((index?.count ?? position.count) / 3);
  const each = Math.max(1, Math.ceil(count / MOST));
  const corner = (n: number) => {
    const at = index ? index.getX(n) : n;
    const [x, y, z] = [position.getX(at), position.getY(at), position.getZ(at)];
    return { right: (x + y) * Math.SQRT1_2, up: z * 0.8165 + (y - x) * 0.4082, far: (y - x) * 0.5774 - z * 0.5774 };
  };
  const triangles: { corners: ReturnType<typeof corner>[]; far: number; light: number }[] = [];
  for (let n = 0; n < count; n += each) {
    const corners = [corner(3 * n), corner(3 * n + 1), corner(3 * n + 2)];
    const [a, b, c] = corners as [ReturnType<typeof corner>, ReturnType<typeof corner>, ReturnType<typeof corner>];
    const cross = (b.right - a.right) * (c.up - a.up) - (b.up - a.up) * (c.right - a.right);
    const [u, v] = [
      Math.hypot(b.right - a.right, b.up - a.up, b.far - a.far),
      Math.hypot(c.right - a.right, c.up - a.up, c.far - a.far),
    ];
    triangles.push({ corners, far: a.far + b.far + c.far, light: u && v ? Math.min(1, Math.abs(cross) / (u * v)) : 0 });
  }
  const all = triangles.flatMap(({ corners }) => corners);
  const bounds = (of: (one: (typeof all)[number]) => number) =>
    all.reduce<[number, number]>(
      ([least, most], one) => [Math.min(least, of(one)), Math.max(most, of(one))],
      [Infinity, -Infinity],
    );
  const [left, right] = bounds((one) => one.right);
  const [low, high] = bounds((one) => one.up);
  const scale = 0.9 * Math.min(width / Math.max(1e-9, right - left), height / Math.max(1e-9, high - low));
  const x = (one: (typeof all)[number]) => width / 2 + (one.right - (left + right) / 2) * scale;
  const y = (one: (typeof all)[number]) => height / 2 - (one.up - (low + high) / 2) * scale;
  for (const { corners, light } of triangles.sort((a, b) => b.far - a.far)) {
    context.fillStyle = context.strokeStyle = `hsl(208 24% ${38 + light * 38}%)`;
    context.beginPath();
    corners.forEach((one, n) => (n ? context.lineTo(x(one), y(one)) : context.moveTo(x(one), y(one))));
    context.closePath();
    context.fill();
    context.stroke();
  }
}
