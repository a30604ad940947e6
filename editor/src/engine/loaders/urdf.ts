/** A robot as the server makes it ready to be shown: its URDF with its meshes. A chunk of its own. */

import { LoadingManager, type Material, Mesh } from "three";
import URDFLoader, { type URDFRobot } from "urdf-loader";
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
  if (extras.urdf === undefined) throw new Error("it is no robot");
  // The loader takes the scheme away before it asks.
  const named = new Map(Object.entries(extras.meshes ?? {}).map(([reference, name]) => [reference.replace(/^package:\/\//, ""), name]));
  const loader = new URDFLoader(new LoadingManager());
  loader.packages = (packageName: string) => packageName;
  loader.loadMeshCb = (path, _manager, _material, done) => {
    const geometry = meshes.get(named.get(path) ?? "");
    if (geometry) done(new Mesh(geometry, plain));
  };
  const robot = loader.parse(extras.urdf);
  robot.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh) return;
    mesh.material = mesh.geometry.hasAttribute("color") ? coloured : plain;
    mesh.castShadow = true;
  });
  return { robot, problems: [...new Set(Object.values(extras.problems ?? {}))] };
}
