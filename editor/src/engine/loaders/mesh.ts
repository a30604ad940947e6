/** Read uploaded meshes as one geometry in the unit of the file. A separate chunk. */

import { t } from "@lingui/core/macro";
import { type BufferGeometry, type Group, LoadingManager, Matrix4, type Mesh, type Object3D } from "three";
import { ColladaLoader } from "three/examples/jsm/loaders/ColladaLoader.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";

/** Read a mesh; its format is detected by its first bytes, or by its name. */
export async function loadMesh(content: ArrayBuffer, name: string): Promise<BufferGeometry> {
  const head = new TextDecoder("latin1").decode(content.slice(0, 512));
  const ending = name.toLowerCase().split(".").pop();
  if (head.startsWith("glTF") || ending === "gltf") {
    const { scene } = await new GLTFLoader(noFetch()).parseAsync(content, "");
    // glTF has y up; here z is up.
    return whole(scene, new Matrix4().makeRotationX(Math.PI / 2));
  }
  if (head.startsWith("ply")) return withNormals(new PLYLoader().parse(content));
  if (head.includes("<COLLADA")) {
    const read = new ColladaLoader(noFetch()).parse(new TextDecoder().decode(content), "");
    if (!read) throw new Error(t`The COLLADA file cannot be read.`);
    // The loader converts z-up to y-up; undo that.
    return whole(read.scene as unknown as Group, new Matrix4().makeRotationX(Math.PI / 2));
  }
  if (ending === "obj") return whole(new OBJLoader().parse(new TextDecoder().decode(content)));
  return withNormals(new STLLoader().parse(content));
}

/** Referenced files, such as textures, are not loaded. */
function noFetch(): LoadingManager {
  const manager = new LoadingManager();
  manager.setURLModifier(() => "data:,");
  return manager;
}

function withNormals(geometry: BufferGeometry): BufferGeometry {
  if (!geometry.getAttribute("normal")) geometry.computeVertexNormals();
  return geometry;
}

function whole(root: Object3D, turned = new Matrix4()): BufferGeometry {
  root.updateMatrixWorld(true);
  const parts: BufferGeometry[] = [];
  root.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh) return;
    const part = mesh.geometry.index ? mesh.geometry.toNonIndexed() : mesh.geometry.clone();
    for (const attribute of Object.keys(part.attributes)) {
      if (attribute !== "position" && attribute !== "normal") part.deleteAttribute(attribute);
    }
    parts.push(withNormals(part).applyMatrix4(new Matrix4().multiplyMatrices(turned, mesh.matrixWorld)));
  });
  if (parts.length === 0) throw new Error(t`The file contains no surface.`);
  return mergeGeometries(parts);
}
