/**
 * Instances merged into one mesh: software rendering needs as long for an instance as for a hundred triangles. The mesh
 * is only rewritten when a pose or colour changes.
 */

import {
  BufferAttribute,
  BufferGeometry,
  type Color,
  DynamicDrawUsage,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  type Object3D,
  type Scene,
  Vector3,
} from "three";
import { cheapen } from "./surface";

export interface Instance {
  id: string;
  /** Object whose frame it is in. */
  frame: Object3D;
  /** Offset in that frame. */
  offset: Matrix4;
  color: Color;
}

const matrix = new Matrix4();
const place = new Vector3();
const normal = new Vector3();
/** Corners of a square that faces the camera. */
const CORNERS = [-1, -1, 1, -1, 1, 1, -1, 1];

export class Baked {
  private readonly mesh: Mesh;
  private readonly material = new MeshLambertMaterial({ vertexColors: true });
  private room = 0;

  /**
   * Draw `shape` at every instance; spheres with a radius of `ball`, m, if it is not 0, as squares facing the camera.
   */
  constructor(
    private readonly scene: Scene,
    private readonly shape: BufferGeometry,
    private readonly ball: number,
  ) {
    cheapen(this.material, ball > 0);
    this.mesh = new Mesh(new BufferGeometry(), this.material);
    this.mesh.frustumCulled = false;
    this.mesh.raycast = () => {};
    scene.add(this.mesh);
  }

  refresh(instances: readonly Instance[]): void {
    if (instances.length > this.room) this.makeRoom(instances.length * 2);
    this.mesh.visible = instances.length > 0;
    if (instances.length === 0) return;
    const { geometry } = this.mesh;
    const [places, normals, colors] = ["position", "normal", "color"].map(
      (name) => geometry.getAttribute(name) as BufferAttribute,
    ) as [BufferAttribute, BufferAttribute, BufferAttribute];
    let at = 0;
    for (const { frame, offset, color } of instances) {
      matrix.multiplyMatrices(frame.matrixWorld, offset);
      const first = at;
      if (this.ball > 0) {
        const size = this.ball * matrix.getMaxScaleOnAxis();
        place.setFromMatrixPosition(matrix);
        for (let n = 0; n < 8; n += 2, at++) {
          places.setXYZ(at, place.x, place.y, place.z);
          normals.setXYZ(at, CORNERS[n] as number, CORNERS[n + 1] as number, size);
        }
      } else {
        const { position: its, normal: facing } = this.shape.attributes as {
          position: BufferAttribute;
          normal: BufferAttribute;
        };
        for (let n = 0; n < its.count; n++, at++) {
          place.fromBufferAttribute(its, n).applyMatrix4(matrix);
          normal.fromBufferAttribute(facing, n).transformDirection(matrix);
          places.setXYZ(at, place.x, place.y, place.z);
          normals.setXYZ(at, normal.x, normal.y, normal.z);
        }
      }
      for (let n = first; n < at; n++) colors.setXYZ(n, color.r, color.g, color.b);
    }
    for (const each of [places, normals, colors]) each.needsUpdate = true;
    geometry.setDrawRange(0, instances.length * this.corners);
  }

  dispose(): void {
    this.scene.remove(this.mesh);
    this.mesh.geometry.dispose();
    this.material.dispose();
  }

  /** Vertices of the triangles of an instance. */
  private get corners(): number {
    return this.ball > 0 ? 6 : (this.shape.index?.count ?? this.shape.getAttribute("position").count);
  }

  private makeRoom(instances: number): void {
    this.room = instances;
    const index =
      this.ball > 0
        ? [0, 1, 2, 0, 2, 3]
        : this.shape.index
          ? [...this.shape.index.array]
          : [...Array(this.corners).keys()];
    const vertices = this.ball > 0 ? 4 : this.shape.getAttribute("position").count;
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    for (const name of ["position", "normal", "color"]) {
      this.mesh.geometry.setAttribute(
        name,
        new BufferAttribute(new Float32Array(instances * vertices * 3), 3).setUsage(DynamicDrawUsage),
      );
    }
    const all = new Uint32Array(instances * index.length);
    for (let n = 0; n < instances; n++) index.forEach((each, m) => (all[n * index.length + m] = n * vertices + each));
    this.mesh.geometry.setIndex(new BufferAttribute(all, 1));
  }
}
