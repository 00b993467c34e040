// GLSL ES 3.00. A value is a pair (value * weight, weight), so that what is interpolated towards a vertex without one stays
// right. Colours are those of the screen: nothing converts them.

const HEAD = "precision highp float;\nprecision highp int;\n";

/** `lifted` moves a place towards the eye by `lift`, in depth only, so that what lies on the surface is not lost in it. */
const PLACE = `${HEAD}
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float lift;
uniform vec4 cut; // a plane; what is beyond it is not drawn
float beyond(vec3 p) { return dot(cut.xyz, p) - cut.w; }
vec4 lifted(vec4 e) {
  bool parallel = projectionMatrix[3][3] > .5;
  vec4 p = projectionMatrix * e;
  vec4 q = projectionMatrix * vec4(parallel ? e.xyz + vec3(0, 0, lift) : e.xyz * max(0., 1. - lift / length(e.xyz)), 1);
  p.z = q.z / q.w * p.w;
  return p;
}`;

/** The texels of the map of the tolerance are those of `mapBytes`. */
const SCALE = `
uniform sampler2D map;
uniform float low, high, band; // band: the tolerance, of a map with parts; else 0
uniform vec3 below, above, none;
vec3 scaled(vec2 v) {
  if (v.y < .5) return none;
  float x = v.x / v.y;
  if (x < low) return below;
  if (x > high) return above;
  if (band > 0.) {
    float over = min(1., (abs(x) - band) / max(high - band, 1e-30));
    float texel = abs(x) <= band ? 86.5 + 83. * (.5 + .5 * x / band) : x > 0. ? 170.5 + 85. * over : 85.5 - 85. * over;
    return texture(map, vec2(texel / 256., .5)).rgb;
  }
  float t = high > low ? (x - low) / (high - low) : .5;
  return texture(map, vec2(t * (255. / 256.) + .5 / 256., .5)).rgb;
}`;

export const SURFACE_VERTEX = `${PLACE}
in vec3 position, normal;
in vec2 value;
in float support;
out vec3 eye, side;
out vec2 shown;
out float supported, off;
void main() {
  off = beyond(position);
  vec4 e = modelViewMatrix * vec4(position, 1);
  eye = e.xyz;
  side = mat3(modelViewMatrix) * normal;
  shown = value;
  supported = support;
  gl_Position = projectionMatrix * e;
}`;

export const SURFACE_FRAGMENT = `${HEAD}${SCALE}
uniform int mode; // 0 plain, 1 scale, 2 zebra, 3 faces
uniform bool perspective, unsupported, hatched;
uniform vec3 plain;
uniform float stripes, pixel;
in vec3 eye, side;
in vec2 shown;
in float supported, off;
out vec4 colour;
void main() {
  if (off > 0.) discard;
  vec3 facet = cross(dFdx(eye), dFdy(eye)), towards = perspective ? normalize(-eye) : vec3(0, 0, 1);
  vec3 n = normalize(dot(side, side) > 1e-12 ? side : facet);
  bool inside = dot(n, towards) < 0.;
  if (inside) n = -n;
  float angle = asin(clamp(reflect(-towards, n).y, -1., 1.)) / 3.14159265 * stripes, soft = fwidth(angle) * 1.2;
  if (!unsupported && supported < .5) discard;
  // Two lights beside the eye, and what comes from the ground and the sky.
  float light = .31 + .07 * n.y + .56 * max(dot(n, normalize(vec3(-.45, .55, .75))), 0.)
    + .26 * max(dot(n, normalize(vec3(.7, -.1, .6))), 0.);
  float shine = pow(max(dot(n, normalize(normalize(vec3(-.45, .55, .75)) + towards)), 0.), 40.);
  vec3 base = inside ? plain * vec3(.78, .84, .95) : plain;
  if (mode == 1) { base = scaled(shown); light = .36 + .68 * light; shine *= .15; }
  else if (mode == 2) {
    base = vec3(mix(.06, .97, smoothstep(.5 - soft, .5 + soft, abs(fract(angle) - .5) * 2.)));
    light = .62 + .4 * light;
  } else if (mode == 3) base = .62 + .3 * cos(6.2831853 * (shown.x * .618034 + vec3(0, .33, .67)));
  if (hatched && supported < .5) {
    float stripe = fract((gl_FragCoord.x + gl_FragCoord.y) / (7. * pixel));
    base = mix(none, none * .72, smoothstep(.0, .15, stripe) - smoothstep(.35, .5, stripe));
  }
  colour = vec4(min(base * light, 1.) + .22 * shine, 1);
}`;

export const POINT_VERTEX = `${PLACE}
in vec3 position;
in vec2 value;
in float kind; // 0 interior, 1 free edge, 2 held out, 3 and 4 not used, 5 duplicate
uniform float dot_size, least;
uniform bool rejects;
uniform vec2 fade; // depths between which points darken
out vec2 shown;
out float dim;
flat out int state;
void main() {
  vec4 e = modelViewMatrix * vec4(position, 1);
  shown = value;
  state = int(kind + .5);
  gl_PointSize = state == 0 ? dot_size : max(dot_size * 1.4, least);
  dim = 1. - .42 * smoothstep(fade.x, fade.y, -e.z);
  bool hidden = state > 4 || state > 2 && !rejects || beyond(position) > 0.;
  gl_Position = hidden ? vec4(2, 2, 2, 1) : lifted(e);
}`;

export const POINT_FRAGMENT = `${HEAD}${SCALE}
uniform bool coloured;
uniform vec3 plain, rejected;
in vec2 shown;
in float dim;
flat in int state;
out vec4 colour;
void main() {
  vec2 c = gl_PointCoord * 2. - 1.;
  float d = dot(c, c), edge = d;
  if (state == 0 && d > 1.) discard;
  if (state == 1) edge = max(abs(c.x), abs(c.y));
  if (state == 2) { edge = abs(c.x) + abs(c.y); if (edge > 1. || edge < .35) discard; }
  if (state > 2 && abs(abs(c.x) - abs(c.y)) > .4) discard;
  vec3 base = state > 2 ? rejected : coloured ? scaled(shown) : plain;
  colour = vec4(base * dim * (1. - .3 * smoothstep(.5, 1., edge)), 1);
}`;

/** A segment is an instance; its four corners are made here, as lines of WebGL are one pixel wide. */
export const LINE_VERTEX = `${PLACE}
in vec3 from, to;
uniform vec2 screen;
uniform float width;
out float off;
void main() {
  off = gl_VertexID < 2 ? beyond(from) : beyond(to);
  vec4 a = lifted(modelViewMatrix * vec4(from, 1)), b = lifted(modelViewMatrix * vec4(to, 1));
  float near = 1e-5;
  if (a.w < near && b.w < near) { gl_Position = vec4(2, 2, 2, 1); return; }
  if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * screen;
  along = dot(along, along) > 0. ? normalize(along) : vec2(1, 0);
  vec4 p = gl_VertexID < 2 ? a : b;
  p.xy += vec2(-along.y, along.x) * ((gl_VertexID & 1) == 0 ? 1. : -1.) * width / screen * p.w;
  gl_Position = p;
}`;

export const LINE_FRAGMENT = `${HEAD}
uniform vec3 plain;
in float off;
out vec4 colour;
void main() {
  if (off > 0.) discard;
  colour = vec4(plain, 1);
}`;

/** What is under the pointer: the number of the triangle or point in red, green and blue, and which of them in alpha. */
const ID = `
vec4 name(int id, float kind) { return vec4(ivec3(id, id >> 8, id >> 16) & 255, kind) / 255.; }`;

/** The alpha of triangles and of points in the picture of numbers. */
export const TRIANGLE = 85, POINT = 170;

export const PICK_SURFACE_VERTEX = `${PLACE}${ID}
in vec4 position; // with the support
flat out vec4 id;
out float supported, off;
void main() {
  off = beyond(position.xyz);
  id = name(gl_VertexID / 3, ${TRIANGLE}.);
  supported = position.w;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position.xyz, 1);
}`;

export const PICK_POINT_VERTEX = `${PLACE}${ID}
in vec3 position;
in float kind;
uniform float dot_size;
uniform bool rejects;
flat out vec4 id;
out float supported, off;
void main() {
  off = beyond(position);
  id = name(gl_VertexID, ${POINT}.);
  supported = 1.;
  gl_PointSize = dot_size;
  gl_Position = kind > 4.5 || kind > 2.5 && !rejects ? vec4(2, 2, 2, 1) : lifted(modelViewMatrix * vec4(position, 1));
}`;

export const PICK_FRAGMENT = `${HEAD}
uniform bool unsupported;
flat in vec4 id;
in float supported, off;
out vec4 colour;
void main() {
  if (off > 0. || !unsupported && supported < .5) discard;
  colour = id;
}`;
