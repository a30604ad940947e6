/**
 * Cheap drawing for software rendering, where triangles, pixels and draw calls are expensive. A separate chunk.
 *
 * Instances are merged into one mesh: software rendering needs as long for an instance as for a hundred triangles. The
 * mesh is only rewritten when a pose or colour changes.
 */

import {
  BufferAttribute,
  BufferGeometry,
  type Color,
  DynamicDrawUsage,
  Matrix4,
  Mesh,
  type MeshLambertMaterial,
  type Object3D,
  type Scene,
  Vector3,
} from "three";

/** Diffuse lighting as in the Lambert material of three.js, for the two kinds of light that are used. */
const LIT = `
uniform vec3 diffuse;
struct DirectionalLight { vec3 direction; vec3 color; };
uniform DirectionalLight directionalLights[ NUM_DIR_LIGHTS ];
struct HemisphereLight { vec3 direction; vec3 skyColor; vec3 groundColor; };
uniform HemisphereLight hemisphereLights[ NUM_HEMI_LIGHTS ];
#ifdef USE_FOG
uniform vec3 fogColor;
uniform float fogNear;
uniform float fogFar;
#endif
vec3 lit( vec3 color, vec3 normal, float far ) {
  vec3 light = vec3( 0.0 );
  for ( int i = 0; i < NUM_HEMI_LIGHTS; i ++ )
    light += mix(
      hemisphereLights[ i ].groundColor,
      hemisphereLights[ i ].skyColor,
      0.5 * dot( normal, hemisphereLights[ i ].direction ) + 0.5
    );
  for ( int i = 0; i < NUM_DIR_LIGHTS; i ++ )
    light += directionalLights[ i ].color * clamp( dot( normal, directionalLights[ i ].direction ), 0.0, 1.0 );
  vec3 shade = clamp( light * diffuse * color * 0.3183098861837907, 0.0, 1.0 );
  // Approximates sRGB to 0.001 with square roots, which cost a tenth of pow().
  vec3 root = sqrt( shade ), second = sqrt( root );
  shade = clamp(
    0.662002687 * root + 0.684122060 * second - 0.323583601 * sqrt( second ) - 0.0225411470 * shade, 0.0, 1.0
  );
  #ifdef USE_FOG
  shade = mix( shade, fogColor, smoothstep( fogNear, fogFar, far ) );
  #endif
  return shade;
}
#ifdef USE_COLOR
#define OWN vColor.rgb
#else
#define OWN vec3( 1.0 )
#endif
`;

/** Lighting per vertex, since few vertices cover many pixels. */
const CORNERS = {
  vertexShader: `
#include <common>
#include <color_pars_vertex>
${LIT}
varying vec3 vShade;
void main() {
  #include <color_vertex>
  #include <beginnormal_vertex>
  #include <defaultnormal_vertex>
  #include <begin_vertex>
  #include <project_vertex>
  vShade = lit( OWN, normalize( transformedNormal ), - mvPosition.z );
}`,
  fragmentShader: `
uniform float opacity;
varying vec3 vShade;
void main() { gl_FragColor = vec4( vShade, opacity ); }`,
};

/**
 * Squares that face the camera and show a sphere: the normal contains the corner and the half edge, m. They are lit at
 * their corners, because lighting every pixel takes most of the time.
 */
const SQUARES = `
#include <common>
#include <color_pars_vertex>
${LIT}
varying vec2 vPlace;
varying vec3 vShade;
vec4 square() {
  vec4 middle = modelViewMatrix * vec4( position, 1.0 );
  vPlace = normal.xy;
  middle.xy += normal.xy * normal.z;
  gl_Position = projectionMatrix * middle;
  return middle;
}`;
const DISCS = {
  vertexShader: `
${SQUARES}
void main() {
  #include <color_vertex>
  float far = - square().z;
  vShade = lit( OWN, vec3( 0.6 * normal.xy, 0.53 ), far );
}`,
  fragmentShader: `
varying vec2 vPlace;
varying vec3 vShade;
void main() {
  if ( dot( vPlace, vPlace ) > 1.0 ) discard;
  gl_FragColor = vec4( vShade, 1.0 );
}`,
};

/** Squares that show upright pucks: the upper side as an ellipse, and the edge below it. */
const PUCKS = {
  vertexShader: `
${SQUARES}
varying vec3 vUpper;
varying vec3 vUp;
void main() {
  #include <color_vertex>
  float far = - square().z;
  vUp = ( viewMatrix * vec4( 0.0, 0.0, 1.0, 0.0 ) ).xyz;
  if ( vUp.z < 0.0 ) vUp = - vUp;
  vUpper = lit( OWN, vUp, far );
  vShade = lit( OWN, vec3( 0.7 * normal.x, - 0.7 * vUp.z, 0.7 * length( vUp.xy ) ), far );
}`,
  fragmentShader: `
varying vec2 vPlace;
varying vec3 vShade;
varying vec3 vUpper;
varying vec3 vUp;
void main() {
  float tilt = max( length( vUp.xy ), 1e-4 );
  vec2 direction = vUp.xy / tilt;
  float across = vPlace.x * direction.y - vPlace.y * direction.x, along = dot( vPlace, direction );
  float front = vUp.z * sqrt( max( 0.0, 1.0 - across * across ) ), edge = tilt * FLAT;
  if ( abs( along ) > edge + front ) discard;
  gl_FragColor = vec4( along > edge - front ? vUpper : vShade, 1.0 );
}`,
};

/** The shape of drawn instances: their geometry, or squares that show a sphere or an upright puck. */
export type Drawn = "corners" | "discs" | "pucks";
const SHADERS: Record<Drawn, { vertexShader: string; fragmentShader: string }> = {
  corners: CORNERS,
  discs: DISCS,
  pucks: PUCKS,
};

/** Make a diffuse material cheap to draw. `flat` is half the thickness of a puck in radii. */
export function cheapen(material: MeshLambertMaterial, drawn: Drawn = "corners", flat = 0): void {
  material.onBeforeCompile = (shader) => void Object.assign(shader, SHADERS[drawn]);
  material.customProgramCacheKey = () => drawn;
  if (flat) material.defines = { ...material.defines, FLAT: flat.toFixed(4) };
}

export interface Instance {
  id: string;
  /** Object whose frame it is in. */
  frame: Object3D;
  /** Offset in that frame. */
  offset: Matrix4;
  color: Color;
}

const matrix = new Matrix4();
const place = new Vector3();
const normal = new Vector3();
/** Corners of a square that faces the camera. */
const SQUARE = [-1, -1, 1, -1, 1, 1, -1, 1];

export class Baked {
  private readonly mesh: Mesh;
  private capacity = 0;

  /**
   * Draw `shape` at every instance, in a material with vertex colours; spheres or pucks with a radius of `ball`, m, if
   * it is not 0, as squares facing the camera. `flat` is half the thickness of a puck in radii, 0 for spheres.
   */
  constructor(
    private readonly scene: Scene,
    private readonly shape: BufferGeometry,
    private readonly ball: number,
    private readonly material: MeshLambertMaterial,
    flat = 0,
  ) {
    cheapen(this.material, ball > 0 ? (flat > 0 ? "pucks" : "discs") : "corners", flat);
    this.mesh = new Mesh(new BufferGeometry(), this.material);
    this.mesh.frustumCulled = false;
    this.mesh.raycast = () => {};
    scene.add(this.mesh);
  }

  refresh(instances: readonly Instance[]): void {
    if (instances.length > this.capacity) this.grow(instances.length * 2);
    this.mesh.visible = instances.length > 0;
    if (instances.length === 0) return;
    const { geometry } = this.mesh;
    const [places, normals, colors] = ["position", "normal", "color"].map(
      (name) => geometry.getAttribute(name) as BufferAttribute,
    ) as [BufferAttribute, BufferAttribute, BufferAttribute];
    let at = 0;
    for (const { frame, offset, color } of instances) {
      matrix.multiplyMatrices(frame.matrixWorld, offset);
      const first = at;
      if (this.ball > 0) {
        const size = this.ball * matrix.getMaxScaleOnAxis();
        place.setFromMatrixPosition(matrix);
        for (let n = 0; n < 8; n += 2, at++) {
          places.setXYZ(at, place.x, place.y, place.z);
          normals.setXYZ(at, SQUARE[n] as number, SQUARE[n + 1] as number, size);
        }
      } else {
        const { position: its, normal: facing } = this.shape.attributes as {
          position: BufferAttribute;
          normal: BufferAttribute;
        };
        for (let n = 0; n < its.count; n++, at++) {
          place.fromBufferAttribute(its, n).applyMatrix4(matrix);
          normal.fromBufferAttribute(facing, n).transformDirection(matrix);
          places.setXYZ(at, place.x, place.y, place.z);
          normals.setXYZ(at, normal.x, normal.y, normal.z);
        }
      }
      for (let n = first; n < at; n++) colors.setXYZ(n, color.r, color.g, color.b);
    }
    for (const each of [places, normals, colors]) each.needsUpdate = true;
    geometry.setDrawRange(0, instances.length * this.corners);
  }

  dispose(): void {
    this.scene.remove(this.mesh);
    this.mesh.geometry.dispose();
    this.material.dispose();
  }

  /** Number of entries of the index for one instance. */
  private get corners(): number {
    return this.ball > 0 ? 6 : (this.shape.index?.count ?? this.shape.getAttribute("position").count);
  }

  private grow(instances: number): void {
    this.capacity = instances;
    const index =
      this.ball > 0
        ? [0, 1, 2, 0, 2, 3]
        : this.shape.index
          ? [...this.shape.index.array]
          : [...Array(this.corners).keys()];
    const vertices = this.ball > 0 ? 4 : this.shape.getAttribute("position").count;
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    for (const name of ["position", "normal", "color"]) {
      this.mesh.geometry.setAttribute(
        name,
        new BufferAttribute(new Float32Array(instances * vertices * 3), 3).setUsage(DynamicDrawUsage),
      );
    }
    const all = new Uint32Array(instances * index.length);
    for (let n = 0; n < instances; n++) index.forEach((each, m) => (all[n * index.length + m] = n * vertices + each));
    this.mesh.geometry.setIndex(new BufferAttribute(all, 1));
  }
}
