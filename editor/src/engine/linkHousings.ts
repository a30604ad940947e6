/** Robots built of cylinders and spheres: show housings with caps at the joints, and tubes. A separate chunk. */

import { type BufferGeometry, Matrix4, type Mesh, Quaternion, type SphereGeometry, Vector3 } from "three";
import type { URDFJoint, URDFLink } from "urdf-loader";
import { ball, coloured, tube } from "./models";

const BODY = 0xdfe3e8;
const HOUSING = 0xcfd5db;
const CAP = 0x3f7ea8;
/** Radius and length of a housing, relative to the radius and diameter of the arm; the cap is narrower and longer. */
const WIDE = 1.08;
const LONG = 1.12;
const NARROW = 0.8;
const OUT = 1.26;
/** Largest distance of the middle of a housing from the axis of its joint, m. */
const NEAR = 0.004;
const Z = new Vector3(0, 0, 1);

interface Axis {
  through: Vector3;
  along: Vector3;
}

/** Return the axes of the movable joints at both ends of a link, in its frame. */
export function axesOf(link: URDFLink): Axis[] {
  const turns = (joint: Partial<URDFJoint> | null) =>
    joint?.isURDFJoint === true && (joint.jointType === "revolute" || joint.jointType === "continuous");
  const own = link.parent as URDFJoint | null;
  const found: Axis[] = turns(own) && own ? [{ through: new Vector3(), along: own.axis.clone().normalize() }] : [];
  for (const child of link.children as unknown as URDFJoint[])
    if (turns(child))
      found.push({
        through: child.position.clone(),
        along: child.axis.clone().applyQuaternion(child.quaternion).normalize(),
      });
  return found;
}

/** Return the shapes of a link as one geometry with colours. `pieces` are its primitive shapes in its frame. */
export function linkGeometry(
  pieces: readonly { mesh: Mesh; matrix: Matrix4 }[],
  axes: readonly Axis[],
): BufferGeometry {
  const parts: [BufferGeometry, number][] = [];
  const housed: Vector3[] = [];
  for (const { mesh, matrix } of pieces) {
    if (mesh.geometry.type !== "SphereGeometry") {
      parts.push([mesh.geometry.clone().applyMatrix4(matrix), BODY]);
      continue;
    }
    const middle = new Vector3().setFromMatrixPosition(matrix);
    const radius = (mesh.geometry as SphereGeometry).parameters.radius * matrix.getMaxScaleOnAxis();
    const axis = axes.find(({ through, along }) => distanceToLine(middle, through, along) < NEAR);
    if (!axis) parts.push([ball(radius).translate(middle.x, middle.y, middle.z), BODY]);
    else if (!housed.some((other) => other.distanceTo(middle) < radius)) {
      housed.push(middle);
      const turned = new Matrix4().makeRotationFromQuaternion(new Quaternion().setFromUnitVectors(Z, axis.along));
      for (const [width, length, color] of [
        [WIDE, LONG, HOUSING],
        [NARROW, OUT, CAP],
      ] as const)
        parts.push([
          tube(radius * width, 2 * radius * length, "z")
            .applyMatrix4(turned)
            .translate(middle.x, middle.y, middle.z),
          color,
        ]);
    }
  }
  return coloured(parts);
}

/** Return the distance of a point from a line. */
function distanceToLine(point: Vector3, through: Vector3, along: Vector3): number {
  const to = new Vector3().subVectors(point, through);
  return to.addScaledVector(along, -to.dot(along)).length();
}
