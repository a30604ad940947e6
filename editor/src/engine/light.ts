/** Lights of the workplace: the sky, and a sun with shadows. */

import { DirectionalLight, HemisphereLight, type Scene } from "three";

/** Add the lights to a scene; return a function that frees them. */
export function light(scene: Scene): () => void {
  const sky = new HemisphereLight(0xffffff, 0x8d8f94, 1.5);
  const sun = new DirectionalLight(0xffffff, 2.1);
  sky.position.set(0, 0, 1);
  sun.position.set(1.6, -1.1, 3.2);
  sun.castShadow = true; // drawn at high quality only
  sun.shadow.mapSize.set(2048, 2048);
  const { camera } = sun.shadow;
  camera.left = camera.bottom = -2.2;
  camera.right = camera.top = 2.2;
  camera.far = 9;
  sun.shadow.bias = -0.0005;
  sun.shadow.radius = 3;
  scene.add(sky, sun);
  return () => sun.dispose();
}
