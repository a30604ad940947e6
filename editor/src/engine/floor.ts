/** The floor: a grid of 10 cm and 50 cm, the axes of the world with their scale, and the shadows at high quality. */

import {
  BufferGeometry,
  type Color,
  Float32BufferAttribute,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  PlaneGeometry,
  ShadowMaterial,
} from "three";
import { persistently } from "../persistently";
import type { Scale } from "./floorScale";
import type { Palette } from "./palette";
import { boundsOf, type Thing } from "./thing";

/** Half edges of the grid and of its fine part, and the distances of the lines, m. */
const FAR = 12;
const NEAR = 1.5;
const COARSE = 0.5;
const FINE = 0.1;
/** Lines consist of pieces: some drivers drop a line that passes the camera. */
const PIECE = 1;
/** Length of the axes and distance of their marks, m. */
const AXIS = 1;
const STEP = 0.25;

export class Floor {
  private readonly root = new Group();
  private readonly lines = new LineBasicMaterial({ vertexColors: true });
  private readonly grid = new LineSegments(new BufferGeometry(), this.lines);
  private readonly axes = new LineSegments(new BufferGeometry(), this.lines);
  private scale: Scale | null = null;
  private palette: Palette | null = null;
  private readonly ground: Mesh | null = null;

  constructor(scene: { add(each: Group): unknown }, shadows: boolean) {
    this.axes.position.z = 0.0008;
    this.root.add(this.grid, this.axes);
    if (shadows) {
      this.ground = new Mesh(new PlaneGeometry(2 * FAR, 2 * FAR), new ShadowMaterial({ opacity: 0.22 }));
      this.ground.receiveShadow = true;
      this.root.add(this.ground);
    }
    this.root.userData.ground = true;
    scene.add(this.root);
    this.lower(0);
  }

  /** Put the grid below everything, m: parts of a workplace may be under the origin of the world. */
  lower(level: number): void {
    this.grid.position.z = level - 0.001;
    if (this.ground) this.ground.position.z = level - 0.0005;
  }

  paint(palette: Palette): void {
    const grid: [number[], number[]] = [[], []];
    const rule = (half: number, step: number, colour: Color, skip: number) => {
      for (let n = -Math.round(half / step); n <= Math.round(half / step); n++) {
        const at = n * step;
        if (skip && Math.abs(at / skip - Math.round(at / skip)) < 1e-6) continue;
        for (let from = -half; from < half - 1e-6; from += PIECE) {
          const to = Math.min(half, from + PIECE);
          segment(grid, colour, at, from, at, to);
          segment(grid, colour, from, at, to, at);
        }
      }
    };
    rule(NEAR, FINE, palette.gridFine, COARSE);
    rule(FAR, COARSE, palette.grid, 0);
    fill(this.grid.geometry, grid);
    const axes: [number[], number[]] = [[], []];
    for (const [colour, dx, dy] of [
      [palette.axisX, 1, 0],
      [palette.axisY, 0, 1],
    ] as const) {
      const along = (from: number, to: number) => segment(axes, colour, dx * from, dy * from, dx * to, dy * to);
      along(0, AXIS);
      for (let at = STEP; at <= AXIS; at += STEP)
        segment(axes, colour, dx * at - dy * 0.02, dy * at - dx * 0.02, dx * at + dy * 0.02, dy * at + dx * 0.02);
    }
    fill(this.axes.geometry, axes);
    this.palette = palette;
    this.scale?.paint(palette);
  }

  /** Add the numbers, which the first picture does not need; `draw` requests a frame. */
  async addNumbers(draw: () => void): Promise<void> {
    const { Scale } = await persistently(() => import("./floorScale"));
    this.scale = new Scale(AXIS, STEP);
    this.root.add(this.scale.mesh);
    if (this.palette) this.scale.paint(this.palette);
    draw();
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const each of [this.grid, this.axes, this.ground]) each?.geometry.dispose();
    this.scale?.dispose();
    this.lines.dispose();
    (this.ground?.material as ShadowMaterial | undefined)?.dispose();
  }
}

type Lines = [number[], number[]];

function segment([places, colours]: Lines, colour: Color, x1: number, y1: number, x2: number, y2: number): void {
  places.push(x1, y1, 0, x2, y2, 0);
  colours.push(...colour.toArray(), ...colour.toArray());
}

function fill(geometry: BufferGeometry, [places, colours]: Lines): void {
  geometry.setAttribute("position", new Float32BufferAttribute(places, 3));
  geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
  geometry.computeBoundingSphere();
}

/** Return the level of the floor, m: 0, or the lower side of the lowest object below it. */
export function lowest(things: Iterable<Thing>): number {
  let level = 0;
  for (const thing of things) if (thing.item.kind === "object") level = Math.min(level, boundsOf(thing).min.z);
  return level;
}
