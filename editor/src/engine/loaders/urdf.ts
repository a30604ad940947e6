/** A robot as the server makes it ready to be shown: its URDF with its meshes. A chunk of its own. */

import { t } from "@lingui/core/macro";
import { LoadingManager, type Material, Mesh, type Object3D, SphereGeometry } from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import URDFLoader, { type URDFLink, type URDFRobot, type URDFVisual } from "urdf-loader";
import { readGlb } from "./glb";

/** What surfaces are made of: those with colours of their own, and all others. */
export interface RobotMaterials {
  plain: Material;
  coloured: Material;
}

export interface LoadedRobot {
  robot: URDFRobot;
  /** Why meshes are missing, a sentence each. */
  problems: string[];
}

/** Give the robot; what of it cannot be shown is left out. Throws when there is no URDF in it. */
export function loadRobot(content: ArrayBuffer, { plain, coloured }: RobotMaterials): LoadedRobot {
  const { meshes, extras } = readGlb(content);
  if (extras.urdf === undefined) throw new Error(t`The file describes no robot.`);
  // The loader takes the scheme away before it asks.
  const named = new Map(
    Object.entries(extras.meshes ?? {}).map(([reference, name]) => [reference.replace(/^package:\/\//, ""), name]),
  );
  const loader = new URDFLoader(new LoadingManager());
  loader.packages = (packageName: string) => packageName;
  loader.loadMeshCb = (path, _manager, _material, done) => {
    const geometry = meshes.get(named.get(path) ?? "");
    if (geometry) done(new Mesh(geometry, plain));
  };
  const robot = loader.parse(extras.urdf);
  for (const link of Object.values(robot.links)) joinShapes(link);
  robot.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh) return;
    mesh.material = mesh.geometry.hasAttribute("color") ? coloured : plain;
    mesh.castShadow = true;
  });
  return { robot, problems: [...new Set(Object.values(extras.problems ?? {}))] };
}

/** The balls, cylinders and boxes of a link become one mesh: each piece that is drawn costs, however small it is. */
function joinShapes(link: URDFLink): void {
  link.updateWorldMatrix(true, true);
  const base = link.matrixWorld.clone().invert();
  const pieces: Mesh[] = [];
  for (const each of link.children)
    if ((each as Partial<URDFVisual>).isURDFVisual) each.traverse((one) => void (isShape(one) && pieces.push(one)));
  if (pieces.length === 0) return;
  const shapes = pieces.map(({ geometry, matrixWorld }) => {
    // The loader's balls have as many triangles as a whole robot needs.
    const shape = geometry instanceof SphereGeometry ? new SphereGeometry(1, 18, 10) : geometry;
    shape.deleteAttribute("uv");
    return shape.applyMatrix4(base.clone().multiply(matrixWorld));
  });
  for (const piece of pieces) piece.removeFromParent();
  link.add(new Mesh(mergeGeometries(shapes)));
}

/** Whether it is one of the shapes that URDF itself has; the geometries of meshes have no type of their own. */
function isShape(of: Object3D): of is Mesh {
  return (of as Mesh).isMesh && (of as Mesh).geometry.type !== "BufferGeometry";
}
