/** Materials of solid items, also for software rendering, where triangles and pixels are expensive. */

import { MeshLambertMaterial, type MeshLambertMaterialParameters } from "three";

/** How much the view costs to draw: "low" is for machines without a graphics processor. */
export type Quality = "low" | "high";

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
  // sRGB to a thousandth, of roots alone, which cost a tenth of powers.
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

/** Squares that face the camera and show a sphere: the normal contains the corner and the half edge, m. */
const DISCS = {
  vertexShader: `
#include <common>
#include <color_pars_vertex>
varying vec3 vPlace;
void main() {
  #include <color_vertex>
  vec4 middle = modelViewMatrix * vec4( position, 1.0 );
  vPlace = vec3( normal.xy, - middle.z );
  middle.xy += normal.xy * normal.z;
  gl_Position = projectionMatrix * middle;
}`,
  fragmentShader: `
#include <color_pars_fragment>
${LIT}
varying vec3 vPlace;
void main() {
  float off = dot( vPlace.xy, vPlace.xy );
  if ( off > 1.0 ) discard;
  gl_FragColor = vec4( lit( OWN, vec3( vPlace.xy, sqrt( 1.0 - off ) ), vPlace.z ), 1.0 );
}`,
};

/** Make a diffuse material cheap to draw: as it is, or as spheres on squares. */
export function cheapen(material: MeshLambertMaterial, discs = false): void {
  const shaders = discs ? DISCS : CORNERS;
  material.onBeforeCompile = (shader) => void Object.assign(shader, shaders);
  material.customProgramCacheKey = () => (discs ? "discs" : "corners");
}

/** Return a diffuse material with a colour that can be changed. */
export function surface(
  { quality }: { quality: Quality },
  parameters: MeshLambertMaterialParameters = {},
): MeshLambertMaterial {
  const material = new MeshLambertMaterial(parameters);
  if (quality === "low") cheapen(material);
  return material;
}
