/** Lights of the workplace: the sky, a sun with shadows, and the ground. */

import { DirectionalLight, HemisphereLight, Mesh, PlaneGeometry, type Scene, ShadowMaterial } from "three";

/** Add the lights to a scene; return a function that frees them. */
export function light(scene: Scene, shadows: boolean): () => void {
  const sky = new HemisphereLight(0xffffff, 0x8d8f94, 1.5);
  const sun = new DirectionalLight(0xffffff, 2.1);
  sky.position.set(0, 0, 1);
  sun.position.set(1.6, -1.1, 3.2);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  const { camera } = sun.shadow;
  camera.left = camera.bottom = -2.2;
  camera.right = camera.top = 2.2;
  camera.far = 9;
  sun.shadow.bias = -0.0005;
  scene.add(sky, sun);
  if (shadows) {
    const ground = new Mesh(new PlaneGeometry(20, 20), new ShadowMaterial({ opacity: 0.22 }));
    ground.receiveShadow = true;
    ground.userData.ground = true;
    ground.position.z = -0.0005;
    scene.add(ground);
  }
  return () => sun.dispose();
}
