// What the graphics processor computes: radiosity from irradiance, exposure and tone map as `isolux render` has them, false
// colour with contours, and wires of elements.

/** Most contours: a logarithmic range of five decades has 15. */
export const MOST_CONTOURS = 32;

/** Polygons in a row of the table of surfaces; each takes four texels: reflectance and opacity, emission, normal. */
export const TABLE_WIDTH = 1024;

export const SURFACE_VERTEX = /* glsl */ `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform highp sampler2D surfaces;
uniform vec3 eye;
in vec3 position;
in vec3 irradiance;
in uint polygon;
out vec3 arriving;
flat out vec3 reflectance;
flat out vec3 emission;
flat out float opacity;

void main() {
  int at = 4 * int(polygon);
  ivec2 place = ivec2(at % ${4 * TABLE_WIDTH}, at / ${4 * TABLE_WIDTH});
  vec4 first = texelFetch(surfaces, place, 0);
  reflectance = first.rgb;
  opacity = first.a;
  emission = texelFetch(surfaces, place + ivec2(1, 0), 0).rgb;
  arriving = irradiance;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
#ifdef EDGES
  // Edges close the cracks that rasterisation leaves where an edge ends within another. They lie 4 % further off, behind
  // the surfaces that touch them: on slanted ones a pixel spans as much. Only edges of faces that are seen are there.
  vec3 normal = texelFetch(surfaces, place + ivec2(2, 0), 0).xyz;
  if (dot(normal, eye - position) <= 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  vec4 off = projectionMatrix * vec4(1.04 * (modelViewMatrix * vec4(position, 1.0)).xyz, 1.0);
  gl_Position.z = off.z / off.w * gl_Position.w;
#endif
}
`;

export const SURFACE_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
uniform int mode;
uniform float exposure;
uniform float white;
uniform vec3 scalar;
uniform bool luminances;
uniform vec2 range;
uniform bool logarithmic;
uniform highp sampler2D palette;
uniform int contours;
uniform float levels[${MOST_CONTOURS}];
in vec3 arriving;
flat in vec3 reflectance;
flat in vec3 emission;
flat in float opacity;
out vec4 colour;

const float PI = 3.14159265358979;

vec3 encoded(vec3 linear) {
  vec3 low = 12.92 * linear;
  vec3 high = 1.055 * pow(max(linear, vec3(1e-8)), vec3(1.0 / 2.4)) - 0.055;
  return mix(low, high, step(vec3(0.0031308), linear));
}

void main() {
  vec3 leaving = emission + reflectance * arriving;
  float value = dot(scalar, luminances ? leaving / PI : arriving);
  float place = logarithmic ? log(max(value, 1e-30)) : value;
  vec3 shown;
  if (mode == 0) {
    vec3 exposed = max(leaving * (exposure / PI), vec3(0.0));
    float l = dot(exposed, vec3(0.2126, 0.7152, 0.0722));
    shown = encoded(clamp(exposed * ((1.0 + l / (white * white)) / (1.0 + l)), 0.0, 1.0));
  } else {
    float along = clamp((place - range.x) / (range.y - range.x), 0.0, 1.0);
    shown = texture(palette, vec2((along * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  }
  float width = max(fwidth(place), 1e-12);
  float line = 0.0;
  for (int k = 0; k < contours; k++) {
    line = max(line, 1.0 - smoothstep(0.5, 1.5, abs(place - levels[k]) / width));
  }
  float bright = dot(shown, vec3(0.3, 0.6, 0.1));
  shown = mix(shown, vec3(bright > 0.55 ? 0.0 : 1.0), 0.75 * line);
  colour = vec4(shown * opacity, opacity);
}
`;

export const BACK_VERTEX = /* glsl */ `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;

void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}
`;

export const BACK_FRAGMENT = /* glsl */ `
precision highp float;
out vec4 colour;

void main() {
  colour = vec4(0.0, 0.0, 0.0, 1.0);
}
`;

/** Leaves one by one. `inside`: coordinates within the leaf, whether it is a triangle, and its level. */
export const LEAF_VERTEX = /* glsl */ `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec4 inside;
out vec2 place;
flat out float triangular;
flat out float level;

void main() {
  place = inside.xy;
  triangular = inside.z;
  level = inside.w;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}
`;

export const LEAF_FRAGMENT = /* glsl */ `
precision highp float;
uniform bool filled;
uniform float deepest;
uniform highp sampler2D palette;
uniform vec4 wire;
in vec2 place;
flat in float triangular;
flat in float level;
out vec4 colour;

float edge(float distance) {
  return distance / max(fwidth(distance), 1e-9);
}

void main() {
  float nearest = triangular > 0.5
    ? min(min(edge(place.x), edge(place.y)), edge(1.0 - place.x - place.y))
    : min(min(edge(place.x), edge(1.0 - place.x)), min(edge(place.y), edge(1.0 - place.y)));
  float line = (1.0 - smoothstep(0.35, 1.1, nearest)) * wire.a;
  if (filled) {
    vec3 shown = texture(palette, vec2((deepest > 0.0 ? 0.12 + 0.83 * level / deepest : 0.5), 0.5)).rgb;
    colour = vec4(mix(shown, wire.rgb, line), 1.0);
    return;
  }
  if (line < 0.02) discard;
  colour = vec4(wire.rgb * line, line);
}
`;
