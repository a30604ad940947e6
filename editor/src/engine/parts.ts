/**
 * Parts on an object, drawn where sensors detect them. On a belt that runs, a part that leaves a sensor glides at the
 * reported speed until the next sensor detects it. A separate chunk.
 *
 * Sensors report faster than the belt reports its speed (every 0.25 s), so a part can leave a sensor of a belt whose
 * reported speed is still 0. It waits there until the speed arrives.
 */

import { BoxGeometry, type Material, Mesh, type Object3D } from "three";
import type { DetectedPart } from "./items";

/** Time after which a part at a sensor that does not detect it is assumed to be taken away, s. */
const LATE = 2;
/** Time after which a part that has left a sensor of a stopped belt is assumed to be taken away, s. */
const STARTS_WITHIN = 0.6;

interface Glider {
  mesh: Mesh;
  to: DetectedPart;
  /** Whether the object has moved since the part left its sensor. */
  moved: boolean;
  /** Time since it has arrived, or since it left the sensor of an object that has not moved yet, s. */
  waits: number;
}

export class Parts {
  private places: readonly DetectedPart[] = [];
  private readonly meshes = new Map<DetectedPart["sensor"], Mesh>();
  private gliders: Glider[] = [];
  private velocity = 0;
  /** Sign of the last speed; along the x axis until the object moves. */
  private direction = 1;

  constructor(
    private readonly root: Object3D,
    private readonly material: Material,
  ) {}

  /** Show what the sensors report, and the speed of the object along its x axis, m/s. Return whether parts glide. */
  show(places: readonly DetectedPart[], velocity: number): boolean {
    const before = new Set(this.places.filter(({ seen }) => seen).map(({ sensor }) => sensor));
    this.places = places;
    this.velocity = velocity;
    this.direction = Math.sign(velocity) || this.direction;
    if (velocity !== 0)
      for (const glider of this.gliders.filter(({ moved }) => !moved)) {
        glider.moved = true;
        glider.waits = 0;
      }
    for (const place of places) {
      const { sensor, seen } = place;
      if (seen) this.detected(place);
      else if (before.has(sensor)) this.left(place);
    }
    for (const [sensor, mesh] of this.meshes) {
      if (places.some((each) => each.seen && each.sensor === sensor)) continue;
      this.drop(mesh);
      this.meshes.delete(sensor);
    }
    return this.glides;
  }

  /** Move the parts for a time, s; Infinity: remove the parts between sensors. Return whether they move further. */
  step(seconds: number): boolean {
    for (const glider of [...this.gliders]) {
      const { mesh, to } = glider;
      const left = to.position.x - mesh.position.x;
      const distance = Math.min(Math.abs(this.velocity) * seconds, Math.abs(left));
      if (distance > 0) mesh.position.x += Math.sign(left) * distance;
      else if (this.velocity !== 0 || !glider.moved) glider.waits += seconds;
      if (seconds < Infinity && glider.waits < (glider.moved ? LATE : STARTS_WITHIN)) continue;
      this.gliders.splice(this.gliders.indexOf(glider), 1);
      this.drop(mesh);
    }
    return this.glides;
  }

  dispose(): void {
    for (const mesh of [...this.meshes.values(), ...this.gliders.map((each) => each.mesh)]) this.drop(mesh);
  }

  private get glides(): boolean {
    return this.gliders.some(({ moved }) => !moved || this.velocity !== 0);
  }

  private detected(place: DetectedPart): void {
    for (const glider of this.gliders.filter(({ to }) => to.sensor === place.sensor)) this.drop(glider.mesh);
    this.gliders = this.gliders.filter(({ to }) => to.sensor !== place.sensor);
    if (!this.meshes.has(place.sensor)) this.meshes.set(place.sensor, this.mesh(place));
  }

  /** A part has left a sensor: it is on its distance to the next one, if there is one and no part is there. */
  private left(place: DetectedPart): void {
    const ahead = ({ position }: DetectedPart) => (position.x - place.position.x) * this.direction;
    const next = this.places.filter((each) => ahead(each) > 0).sort((a, b) => ahead(a) - ahead(b))[0];
    if (next && !next.seen)
      this.gliders.push({ mesh: this.mesh(place), to: next, moved: this.velocity !== 0, waits: 0 });
  }

  private mesh({ position, size }: DetectedPart): Mesh {
    const mesh = new Mesh(new BoxGeometry(size.x, size.y, size.z), this.material);
    mesh.castShadow = true;
    mesh.position.set(position.x, position.y, position.z);
    this.root.add(mesh);
    return mesh;
  }

  private drop(mesh: Mesh): void {
    mesh.removeFromParent();
    mesh.geometry.dispose();
  }
}
