/**
 * The lines of connections as ribbons that face the camera, equally wide on the screen at any distance, so that they
 * are not built again when the camera moves. A separate chunk.
 */

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Mesh,
  type Scene,
  ShaderMaterial,
  SRGBColorSpace,
  UniformsLib,
  UniformsUtils,
  type Vector3,
} from "three";

/** Half width of lines, pixels, and its least value close to the camera, m. */
const HALF = 1.1;
const THINNEST = 0.0006;
/** Half width and length of arrowheads, in half widths of lines. */
const WIDE = 3.6;
const LONG = 11;

const vertexShader = `
attribute vec3 along;
attribute vec2 offset;
attribute vec3 color;
uniform float pixel;
varying vec3 vColor;
#include <fog_pars_vertex>
void main() {
  vec4 mvPosition = modelViewMatrix * vec4( position, 1.0 );
  vec4 there = projectionMatrix * modelViewMatrix * vec4( position + 0.01 * along, 1.0 );
  gl_Position = projectionMatrix * mvPosition;
  vec2 wide = vec2( projectionMatrix[1][1] / projectionMatrix[0][0], 1.0 );
  vec2 direction = ( there.xy * gl_Position.w - gl_Position.xy * there.w ) * wide;
  direction /= max( length( direction ), 1e-9 );
  float across = max( ${HALF.toFixed(1)} * pixel * gl_Position.w, ${THINNEST} * projectionMatrix[1][1] );
  gl_Position.xy += across * ( offset.x * vec2( - direction.y, direction.x ) + offset.y * direction ) / wide;
  vColor = color;
  #include <fog_vertex>
}`;
const fragmentShader = `
varying vec3 vColor;
#include <fog_pars_fragment>
void main() {
  gl_FragColor = vec4( vColor, 1.0 );
  #include <fog_fragment>
}`;

/** Points of a line with its directions there; each piece of a dashed line is one. */
export interface Strip {
  places: readonly Vector3[];
  directions: readonly Vector3[];
}

export interface Arrow {
  strips: readonly Strip[];
  /** The position and the direction of the arrowhead. */
  head: readonly [Vector3, Vector3];
}

/** An arrow and its colour, #rrggbb without #. */
export interface Line {
  arrow: Arrow;
  color: string;
}

export class LinkMesh {
  readonly mesh = new Mesh(
    new BufferGeometry(),
    new ShaderMaterial({
      uniforms: UniformsUtils.merge([UniformsLib.fog, { pixel: { value: 0.002 } }]),
      vertexShader,
      fragmentShader,
      fog: true,
      side: DoubleSide,
    }),
  );

  constructor(scene: Scene) {
    this.mesh.raycast = () => {}; // the connections themselves are picked
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    scene.add(this.mesh);
  }

  /** Set the height of the view, pixels. */
  set height(pixels: number) {
    this.mesh.material.uniforms.pixel = { value: 2 / pixels };
  }

  /** Draw these lines and no others. */
  show(lines: readonly Line[]): void {
    const places: number[] = [];
    const directions: number[] = [];
    const offsets: number[] = [];
    const colors: number[] = [];
    const index: number[] = [];
    for (const { arrow, color } of lines) {
      const { r, g, b } = new Color(`#${color}`).getRGB({ r: 0, g: 0, b: 0 }, SRGBColorSpace);
      const corner = (place: Vector3, direction: Vector3, across: number, ahead: number) => {
        places.push(place.x, place.y, place.z);
        directions.push(direction.x, direction.y, direction.z);
        offsets.push(across, ahead);
        colors.push(r, g, b);
      };
      for (const strip of arrow.strips)
        strip.places.forEach((place, n) => {
          const first = offsets.length / 2;
          if (n > 0) index.push(first - 2, first - 1, first, first, first - 1, first + 1);
          const direction = strip.directions[n] as Vector3;
          corner(place, direction, -1, 0);
          corner(place, direction, 1, 0);
        });
      const first = offsets.length / 2;
      index.push(first, first + 1, first + 2);
      corner(...arrow.head, -WIDE, -LONG / 2);
      corner(...arrow.head, WIDE, -LONG / 2);
      corner(...arrow.head, 0, LONG / 2);
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry().setIndex(index);
    for (const [name, values, size] of [
      ["position", places, 3],
      ["along", directions, 3],
      ["offset", offsets, 2],
      ["color", colors, 3],
    ] as const)
      this.mesh.geometry.setAttribute(name, new BufferAttribute(new Float32Array(values), size));
    this.mesh.visible = index.length > 0;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
