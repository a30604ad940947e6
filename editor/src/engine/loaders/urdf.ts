/** Load a robot prepared by the server: its URDF with meshes. A separate chunk. */

import { t } from "@lingui/core/macro";
import { LoadingManager, type Material, Mesh, type Object3D } from "three";
import URDFLoader, { type URDFLink, type URDFRobot, type URDFVisual } from "urdf-loader";
import { axesOf, linkGeometry } from "../linkHousings";
import { readGlb } from "./glb";

/** Materials: for coloured surfaces, and for all others. */
interface RobotMaterials {
  plain: Material;
  coloured: Material;
}

interface LoadedRobot {
  robot: URDFRobot;
  /** The reasons why meshes are missing, one sentence each. */
  problems: string[];
}

/** Return the robot without the parts that cannot be shown. Throw if there is no URDF. */
export function loadRobot(content: ArrayBuffer, { plain, coloured }: RobotMaterials): LoadedRobot {
  const { meshes, extras } = readGlb(content);
  if (extras.urdf === undefined) throw new Error(t`The file describes no robot.`);
  // The loader removes the scheme from the URL.
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

/** Merge the primitive shapes of a link into one mesh: each draw call has a cost. */
function joinShapes(link: URDFLink): void {
  link.updateWorldMatrix(true, true);
  const base = link.matrixWorld.clone().invert();
  const pieces: Mesh[] = [];
  for (const each of link.children)
    if ((each as Partial<URDFVisual>).isURDFVisual) each.traverse((one) => void (isShape(one) && pieces.push(one)));
  if (pieces.length === 0) return;
  const shapes = pieces.map((mesh) => ({ mesh, matrix: base.clone().multiply(mesh.matrixWorld) }));
  const geometry = linkGeometry(shapes, axesOf(link));
  for (const piece of pieces) piece.removeFromParent();
  link.add(new Mesh(geometry));
}

/** Return whether it is a URDF primitive; meshes have no geometry type. */
function isShape(of: Object3D): of is Mesh {
  return (of as Mesh).isMesh && (of as Mesh).geometry.type !== "BufferGeometry";
}
