/** Numbers and names of the axes on the floor. A separate chunk. */

import {
  BufferGeometry,
  CanvasTexture,
  DoubleSide,
  Float32BufferAttribute,
  Mesh,
  MeshBasicMaterial,
  SRGBColorSpace,
} from "three";
import type { Palette } from "./palette";

/** Size of letters, m, and of their parts of the texture, pixels. */
const LETTER = 0.05;
const CELL = 128;
const WORDS = ["0.25", "0.5", "0.75", "1 m", "X", "Y"];

export class Scale {
  private readonly letters = new MeshBasicMaterial({ transparent: true, depthWrite: false, side: DoubleSide });
  readonly mesh: Mesh;

  /** `axis` is the length of the axes, `step` the distance of their marks, m. */
  constructor(axis: number, step: number) {
    this.mesh = new Mesh(lettering(axis, step), this.letters);
    this.mesh.position.z = 0.001;
  }

  paint(palette: Palette): void {
    this.letters.map?.dispose();
    this.letters.map = written(palette);
    this.letters.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.letters.map?.dispose();
    this.letters.dispose();
  }
}

/** Squares on the floor for the numbers and names of both axes, each with its part of the texture. */
function lettering(axis: number, step: number): BufferGeometry {
  const places: number[] = [];
  const uvs: number[] = [];
  const square = (word: number, x: number, y: number) => {
    const [w, h] = [LETTER * 1.6, LETTER * 0.8];
    const [u, U] = [word / WORDS.length, (word + 1) / WORDS.length];
    for (const [dx, dy] of [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, -1],
      [1, 1],
      [-1, 1],
    ] as const) {
      places.push(x + (dx * w) / 2, y + (dy * h) / 2, 0);
      uvs.push(dx < 0 ? u : U, dy < 0 ? 0 : 1);
    }
  };
  for (let n = 0; n < 4; n++) {
    square(n, (n + 1) * step, -0.05);
    square(n, -0.065, (n + 1) * step);
  }
  square(4, axis + 0.08, 0);
  square(5, 0, axis + 0.06);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(places, 3));
  geometry.setAttribute("uv", new Float32BufferAttribute(uvs, 2));
  return geometry;
}

function written(palette: Palette): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = CELL * WORDS.length;
  canvas.height = CELL / 2;
  const pen = canvas.getContext("2d") as CanvasRenderingContext2D;
  pen.font = `600 ${CELL * 0.36}px system-ui, sans-serif`;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  WORDS.forEach((word, n) => {
    const colour = word === "X" ? palette.axisX : word === "Y" ? palette.axisY : palette.gridStrong;
    pen.fillStyle = `#${colour.getHexString()}`;
    pen.fillText(word, CELL * (n + 0.5), CELL / 4, CELL);
  });
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  return map;
}
