/** A robot's URDF with its meshes, from a zip as the server keeps it or as a lone file. A chunk of its own. */

import { LoadingManager, type Material, Mesh } from "three";
import { strFromU8, unzipSync } from "three/examples/jsm/libs/fflate.module.js";
import URDFLoader, { type URDFRobot } from "urdf-loader";

/** Bytes that an archive may have unpacked: a file of some kilobytes can claim to be any size. */
const MOST = 512 * 1024 * 1024;

/** Give the robot, every surface in one material. Throws when there is no URDF in it, or a mesh is missing. */
export async function loadRobot(content: ArrayBuffer, material: Material): Promise<URDFRobot> {
  const files = unpacked(new Uint8Array(content));
  const name = Object.keys(files).find((each) => each.toLowerCase().endsWith(".urdf"));
  if (name === undefined) throw new Error("there is no .urdf in the package");
  const loading: Promise<void>[] = [];
  const loader = new URDFLoader(new LoadingManager());
  loader.packages = (packageName: string) => packageName;
  loader.loadMeshCb = (path, _manager, _material, done) => {
    const found = fileOf(files, path);
    const mesh = found
      ? import("./mesh").then(({ loadMesh }) => loadMesh(found.slice().buffer as ArrayBuffer, path))
      : Promise.reject(new Error("it is not in the package"));
    loading.push(
      mesh.then(
        (geometry) => done(new Mesh(geometry, material)),
        (error: unknown) => console.warn(`${path} cannot be shown: ${String(error)}`),
      ),
    );
  };
  const robot = loader.parse(strFromU8(files[name] as Uint8Array));
  await Promise.all(loading);
  robot.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh) return;
    mesh.material = material;
    mesh.castShadow = true;
  });
  return robot;
}

function unpacked(content: Uint8Array): Record<string, Uint8Array> {
  if (content[0] !== 0x50 || content[1] !== 0x4b) return { "robot.urdf": content };
  let total = 0;
  return unzipSync(content, {
    filter: (file) => {
      total += file.originalSize;
      if (total > MOST) throw new Error("the package is too large");
      return true;
    },
  });
}

/** The file that a path of the URDF means: archives may have a folder above what `package://` names. */
function fileOf(files: Record<string, Uint8Array>, path: string): Uint8Array | undefined {
  const wanted = path.replace(/^[a-z]+:\/\//, "").replace(/^(\.?\/)+/, "");
  const parts = wanted.split("/");
  for (let skipped = 0; skipped < parts.length; skipped++) {
    const ending = parts.slice(skipped).join("/");
    const found = Object.keys(files).find((each) => each === ending || each.endsWith(`/${ending}`));
    if (found) return files[found];
  }
  return undefined;
}
