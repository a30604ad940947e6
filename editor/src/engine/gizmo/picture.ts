/** The model of the gizmo: drawn over everything, with coloured and lettered axes. */

import {
  BoxGeometry,
  type BufferGeometry,
  CanvasTexture,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DoubleSide,
  Group,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  type Quaternion,
  type Scene,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  TorusGeometry,
  type Vector3,
} from "three";
import { disposeTree } from "../thing";
import { type Axis, type Handle, keyOf, perpendicular, RING, SHAFT, SQUARE, UNIT } from "./handles";

const COLOURS: Record<Axis, Color> = { x: new Color(0xd8342b), y: new Color(0x2a9d3f), z: new Color(0x2f6fe0) };
const PLAIN = new Color(0x8a8f98);
const LIT = new Color(0xff9500);
const ABOVE_ALL = 900;

export class Picture {
  private readonly root = new Group();
  private readonly parts = new Map<
    string,
    { handle: Handle; group: Group; material: MeshBasicMaterial; color: Color }
  >();
  /** Textures of the letters, drawn when they are needed. */
  private readonly letters = new Map<Axis, CanvasTexture>();

  constructor(scene: Scene) {
    // Not pickable: the gizmo finds its handles itself.
    this.root.userData.ground = true;
    this.root.userData.handles = true;
    scene.add(this.root);
  }

  /** Show these handles and no others. */
  show(handles: Handle[]): void {
    const wanted = new Set(handles.map(keyOf));
    for (const [key, part] of [...this.parts]) {
      if (wanted.has(key)) continue;
      part.group.removeFromParent();
      disposeTree(part.group);
      this.parts.delete(key);
    }
    for (const handle of handles) {
      const key = keyOf(handle);
      if (this.parts.has(key)) continue;
      const color = handle.kind === "free" ? PLAIN : COLOURS[handle.axis];
      const material = new MeshBasicMaterial({
        color,
        depthTest: false,
        transparent: true,
        opacity: 0.95,
        side: DoubleSide,
      });
      if (handle.kind === "plane") material.opacity = 0.55;
      const group = shape(handle, material, (axis) => this.letter(axis));
      group.traverse((each) => {
        each.renderOrder = ABOVE_ALL;
      });
      this.root.add(group);
      this.parts.set(key, { handle, group, material, color });
    }
    this.root.visible = handles.length > 0;
  }

  highlight(key: string): void {
    for (const [each, { material, color }] of this.parts) material.color.copy(each === key ? LIT : color);
  }

  place(
    at: Vector3,
    turned: Quaternion,
    scale: number,
    half: Record<Axis, number>,
    short: (handle: Handle) => boolean,
  ): void {
    this.root.position.copy(at);
    this.root.quaternion.copy(turned);
    this.root.scale.setScalar(scale);
    for (const { handle, group } of this.parts.values()) {
      group.visible = !short(handle);
      if (handle.kind === "face")
        group.position.copy(UNIT[handle.axis]).multiplyScalar(handle.sign * half[handle.axis]);
    }
    this.root.updateMatrixWorld();
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const { group } of this.parts.values()) disposeTree(group);
    this.parts.clear();
    for (const texture of this.letters.values()) texture.dispose();
    this.letters.clear();
  }

  private letter(axis: Axis): CanvasTexture {
    const texture = this.letters.get(axis) ?? letterOf(axis);
    this.letters.set(axis, texture);
    return texture;
  }
}

function shape(handle: Handle, material: MeshBasicMaterial, letterOf: (axis: Axis) => CanvasTexture): Group {
  const group = new Group();
  const add = (geometry: BufferGeometry) => group.add(new Mesh(geometry, material));
  switch (handle.kind) {
    case "free":
      add(new SphereGeometry(0.09, 16, 12));
      break;
    case "axis": {
      const [from, to] = SHAFT;
      const upright = towards(handle.axis);
      add(
        new CylinderGeometry(0.02, 0.02, to - from - 0.16, 8)
          .translate(0, (from + to - 0.16) / 2, 0)
          .applyMatrix4(upright),
      );
      add(new ConeGeometry(0.075, 0.2, 16).translate(0, to - 0.08, 0).applyMatrix4(upright));
      const letter = new Sprite(new SpriteMaterial({ map: letterOf(handle.axis), depthTest: false }));
      letter.scale.setScalar(0.2);
      letter.position.copy(UNIT[handle.axis]).multiplyScalar(to + 0.17);
      group.add(letter);
      break;
    }
    case "plane": {
      const [from, to] = SQUARE;
      const [a, b] = perpendicular(handle.axis);
      const middle = (from + to) / 2;
      const basis = new Matrix4().makeBasis(a, b, UNIT[handle.axis]);
      add(new PlaneGeometry(to - from, to - from).translate(middle, middle, 0).applyMatrix4(basis));
      break;
    }
    case "ring": {
      const [a, b] = perpendicular(handle.axis);
      add(new TorusGeometry(RING, 0.022, 8, 64).applyMatrix4(new Matrix4().makeBasis(a, b, UNIT[handle.axis])));
      break;
    }
    case "face":
      add(new BoxGeometry(0.14, 0.14, 0.14));
  }
  return group;
}

/** Rotation from the y axis to an axis. */
function towards(axis: Axis): Matrix4 {
  if (axis === "x") return new Matrix4().makeRotationZ(-Math.PI / 2);
  if (axis === "z") return new Matrix4().makeRotationX(Math.PI / 2);
  return new Matrix4();
}

/** Return a texture with the letter of an axis. */
function letterOf(axis: Axis): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const context = canvas.getContext("2d");
  if (context) {
    context.fillStyle = `#${COLOURS[axis].getHexString()}`;
    context.beginPath();
    context.arc(32, 32, 31, 0, 2 * Math.PI);
    context.fill();
    context.fillStyle = "#fff";
    context.font = "bold 44px sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(axis.toUpperCase(), 32, 34);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}
