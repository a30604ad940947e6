/** Many equal small items in one draw call: points, pucks, arrows. Each has its frame in the scene graph. */

import {
  type BufferGeometry,
  Color,
  DynamicDrawUsage,
  InstancedMesh,
  type Material,
  Matrix4,
  MeshLambertMaterial,
  type Scene,
} from "three";
import type { Baked, Instance } from "./baked";
import { LinkLines } from "./linkLines";
import type { LowQuality } from "./surface";

const FIRST_SIZE = 64;
const matrix = new Matrix4();

/** One geometry and material, drawn at every instance; with `baked`, the instances serve only for picking. */
export class Batch {
  private mesh: InstancedMesh;
  private readonly instances: Instance[] = [];

  constructor(
    private readonly scene: Scene,
    private readonly geometry: BufferGeometry,
    private readonly material: Material,
    private readonly baked: Baked | null,
  ) {
    this.mesh = this.createMesh(FIRST_SIZE);
  }

  add(instance: Instance): void {
    this.instances.push(instance);
  }

  remove(instance: Instance): void {
    const index = this.instances.indexOf(instance);
    if (index < 0) return;
    const last = this.instances.pop() as Instance;
    if (last !== instance) this.instances[index] = last;
  }

  /** Update the frames and colours. */
  refresh(): void {
    if (this.instances.length > this.mesh.instanceMatrix.count) {
      this.scene.remove(this.mesh);
      this.mesh.dispose();
      this.mesh = this.createMesh(this.instances.length * 2);
    }
    this.mesh.count = this.instances.length;
    this.mesh.visible = this.mesh.count > 0 && !this.baked;
    this.instances.forEach((each, index) => {
      this.mesh.setMatrixAt(index, matrix.multiplyMatrices(each.frame.matrixWorld, each.offset));
      this.mesh.setColorAt(index, each.color);
    });
    this.mesh.instanceMatrix.needsUpdate = true;
    if (this.mesh.instanceColor) this.mesh.instanceColor.needsUpdate = true;
    this.mesh.computeBoundingSphere();
    this.baked?.refresh(this.instances);
  }

  dispose(): void {
    this.scene.remove(this.mesh);
    this.mesh.dispose();
    this.baked?.dispose();
    this.geometry.dispose();
    this.material.dispose();
  }

  private createMesh(size: number): InstancedMesh {
    const mesh = new InstancedMesh(this.geometry, this.material, size);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.setColorAt(0, new Color(1, 1, 1)); // creates the attribute, so that the shader is compiled only once
    mesh.count = 0;
    mesh.userData.batch = (index: number) => this.instances[index]?.id;
    this.scene.add(mesh);
    return mesh;
  }
}

/** The batches by name; the first user of a name creates the batch. */
export class Batches {
  readonly links: LinkLines;
  private readonly byName = new Map<string, Batch>();

  constructor(
    private readonly scene: Scene,
    private readonly low: LowQuality | null,
    draw: () => void,
  ) {
    this.links = new LinkLines(scene, draw);
  }

  /**
   * At low quality, spheres with a radius of `ball`, m, are drawn as squares, and so are upright pucks, whose half
   * thickness in radii is `flat`.
   */
  of(name: string, make: () => [BufferGeometry, Material], ball = 0, flat = 0): Batch {
    let batch = this.byName.get(name);
    if (!batch) {
      const [geometry, material] = make();
      const painted = () => new MeshLambertMaterial({ vertexColors: true });
      const baked = this.low && new this.low.Baked(this.scene, geometry, ball, painted(), flat);
      batch = new Batch(this.scene, geometry, material, baked);
      this.byName.set(name, batch);
    }
    return batch;
  }

  refresh(): void {
    this.links.refresh();
    for (const batch of this.byName.values()) batch.refresh();
  }

  dispose(): void {
    this.links.dispose();
    for (const batch of this.byName.values()) batch.dispose();
    this.byName.clear();
  }
}
