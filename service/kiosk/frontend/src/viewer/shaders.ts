/** GLSL of the surface and of points. */

/** sRGB's transfer curve (IEC 61966-2-1): light is added up linearly, colours are stored so. */
const TRANSFER = /* glsl */ `
vec3 toLinear(vec3 c) {
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}
vec3 toSrgb(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}`;

/** A photograph's light is in its colours already, so that light is added sparingly: a surface that
 * faces the viewer keeps its colour, what turns away is darkened softly. The lights stand still
 * before the viewer. */
const LIGHT = /* glsl */ `
const vec3 KEY = vec3(-0.42, 0.50, 0.757);
const vec3 SKY = vec3(0.60, 0.61, 0.63);
const vec3 GROUND = vec3(0.40, 0.36, 0.34);
const vec3 LAMP = vec3(0.56, 0.545, 0.52);
/* Skin lets light in: it goes a little round the edge of the shadow. */
const float WRAP = 0.30;
vec3 light(vec3 n) {
  float key = clamp((dot(n, KEY) + WRAP) / (1.0 + WRAP), 0.0, 1.0);
  return mix(GROUND, SKY, 0.5 + 0.5 * n.y) + LAMP * key;
}
/* For the colours of the scale, which are to be found in its legend: a grazing light, about 1 on
 * what faces the viewer, so that a face is seen in them. */
float relief(vec3 n) {
  const vec3 GRAZING = vec3(-0.62, 0.52, 0.588);
  return clamp(0.46 + 0.92 * dot(n, GRAZING), 0.45, 1.2);
}
/* Less on dark skin, where it would look like dust. */
float sheen(vec3 n, vec3 skin) {
  vec3 between = normalize(KEY + vec3(0.0, 0.0, 1.0));
  return (0.008 + 0.07 * skin.g) * pow(clamp(dot(n, between), 0.0, 1.0), 22.0);
}`;

const SIGMA = /* glsl */ `
uniform sampler2D scale;
uniform vec2 sigmaCodes; /* place on the scale of codes 0 and 255 */
uniform float confidence;
vec3 ofSigma(float code) {
  float at = clamp(mix(sigmaCodes.x, sigmaCodes.y, code), 0.002, 0.998);
  return texture2D(scale, vec2(at, 0.5)).rgb;
}`;

/** `position`: mm; `bearing`: normal and distance to the rim; `tint`: sRGB and code of sigma. */
const ATTRIBUTES = /* glsl */ `
attribute vec4 bearing;
attribute vec4 tint;`;

/** Colours are made for each vertex: triangles are hardly larger than pixels, and a processor that
 * stands in for a graphics card has the fewest of them. */
export const surfaceVertex = /* glsl */ `${ATTRIBUTES}
varying vec3 color;
varying float rim;
${TRANSFER}${LIGHT}${SIGMA}
void main() {
  vec3 n = normalize(mat3(modelViewMatrix) * bearing.xyz);
  vec3 lit = light(n);
  vec3 skin = toLinear(tint.rgb);
  skin = skin * lit + sheen(n, skin);
  vec3 shown = toLinear(ofSigma(tint.a)) * relief(n);
  color = toSrgb(mix(skin, shown, confidence));
  rim = bearing.w;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

export const surfaceFragment = /* glsl */ `
varying vec3 color;
varying float rim;
void main() {
  float cover = smoothstep(0.1, 0.9, rim);
  if (cover < 0.02) discard;
  gl_FragColor = vec4(color * (gl_FrontFacing ? cover : 0.5 * cover), cover);
}`;

/** What hides the dots behind it. */
export const screenVertex = /* glsl */ `
uniform float behind; /* mm */
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * (seen - vec4(0.0, 0.0, behind, 0.0));
}`;

/** Round dots of a `diameter` in mm; `focal` turns mm at a distance of 1 mm into pixels. A pixel more
 * is drawn, in which the edge is smoothed. */
export const dotVertex = /* glsl */ `${ATTRIBUTES}
uniform float diameter;
uniform float focal;
uniform float shaded;
varying vec3 color;
varying float size;
${TRANSFER}${LIGHT}${SIGMA}
void main() {
  /* The gaps between dots are dark: what is shaded is lit more. */
  vec3 n = normalize(mat3(modelViewMatrix) * bearing.xyz);
  vec3 lit = mix(vec3(1.0), 1.2 * light(n), shaded);
  color = toSrgb(mix(toLinear(tint.rgb) * lit, toLinear(ofSigma(tint.a)), confidence));
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * seen;
  size = max(1.0, diameter * focal / -seen.z);
  gl_PointSize = size + 1.0;
}`;

export const dotFragment = /* glsl */ `
varying vec3 color;
varying float size;
void main() {
  float away = length(gl_PointCoord - 0.5) * (size + 1.0);
  float cover = clamp(size / 2.0 - away + 0.5, 0.0, 1.0);
  if (cover < 0.3) discard;
  gl_FragColor = vec4(color * cover, cover);
}`;
