// The scripts of the page are joined, inside one function, in the order that page.rs has them.

// The data of the page: JSON with lists of numbers as packed.rs writes them.

const NONE = -0x80000000; // no number

async function inflate(text) {
  const raw = atob(text), bytes = Uint8Array.from({ length: raw.length }, (_, i) => raw.charCodeAt(i));
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack it; any browser of 2023 or later does");
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The integers of a packed list.
async function integersOf({ count, width, order, deflate }) {
  const n = count * width, planes = await inflate(deflate), found = new Int32Array(n);
  for (let k = 0; k < n; k++) {
    const z = planes[k] | planes[n + k] << 8 | planes[2 * n + k] << 16 | planes[3 * n + k] << 24, rest = z >>> 1 ^ -(z & 1);
    const one = order > 0 && k >= width ? found[k - width] : 0;
    found[k] = (order > 1 ? 2 * one - (k >= 2 * width ? found[k - 2 * width] : 0) : one) + rest;
  }
  return found;
}

// A packed list, as an array of the type; null without any numbers.
async function unpack(packed, Type) {
  if (!packed?.count) return null;
  const whole = await integersOf(packed), { step } = packed;
  return step ? Type.from(whole, (x) => (x === NONE ? NaN : step * x)) : Type.from(whole);
}

// Unit vectors of their octahedral projections.
async function unpackDirections(packed) {
  const flat = await unpack(packed, Float32Array);
  if (!flat) return null;
  const found = new Float32Array(flat.length / 2 * 3);
  for (let i = 0; 2 * i < flat.length; i++) {
    let a = flat[2 * i], b = flat[2 * i + 1];
    const z = 1 - Math.abs(a) - Math.abs(b), sign = (x) => (x < 0 ? -1 : 1);
    if (z < 0) [a, b] = [(1 - Math.abs(b)) * sign(a), (1 - Math.abs(a)) * sign(b)];
    const size = Math.hypot(a, b, z);
    found.set([a / size, b / size, z / size], 3 * i);
  }
  return found;
}

// The first state of points that are not used, and the one that is not drawn: duplicates lie on used points.
const UNUSED = 3, DUPLICATE = 5;

async function readData() {
  const data = JSON.parse(document.getElementById("data").textContent);
  data.origin ||= [0, 0, 0];
  data.unit ||= "";
  if (!data.shown_in?.length) data.shown_in = [{ from: 0, factor: 1, symbol: data.unit }];
  for (const list of ["inputs", "tables", "details", "worst", "faces", "poles", "fields", "joins"]) data[list] ||= [];
  data.mesh = await readMesh(data.mesh);
  data.points = await readPoints(data.points);
  for (const name of ["edges", "seams", "iso_curves", "control_net"]) {
    const line = data.lines?.[name], positions = await unpack(line?.positions, Float32Array);
    data.lines = { ...data.lines, [name]: positions ? { positions, lengths: line.lengths } : null };
  }
  data.bounds = boundsOf(data);
  return data;
}

async function readMesh(mesh) {
  const positions = await unpack(mesh?.positions, Float32Array), triangles = await unpack(mesh?.triangles, Uint32Array);
  if (!positions || !triangles) return null;
  return {
    positions, triangles,
    normals: await unpackDirections(mesh.normals),
    parameters: await unpack(mesh.parameters, Float32Array),
    faces: await unpack(mesh.vertex_faces, Uint32Array),
    deviation: await unpack(mesh.deviation, Float32Array),
    mean: await unpack(mesh.mean_curvature, Float32Array),
    gaussian: await unpack(mesh.gaussian_curvature, Float32Array),
  };
}

async function readPoints(points) {
  const positions = await unpack(points?.positions, Float32Array);
  if (!positions) return null;
  const count = positions.length / 3;
  return {
    positions, count,
    total: points.total ?? count,
    deviation: await unpack(points.deviation, Float32Array),
    index: await unpack(points.index, Uint32Array),
    parameters: await unpack(points.parameters, Float32Array),
    faces: await unpack(points.faces, Uint32Array),
    state: await unpack(points.state, Uint8Array) ?? new Uint8Array(count),
    notFinite: await unpack(points.not_finite, Uint32Array) ?? [],
  };
}

// What the view is fitted to: the surface and the points that count, or the lines where there is neither. `size` is the
// diagonal of the surface, where there is one, and `reach` the radius that holds all that is drawn.
function boundsOf({ mesh, points, lines }) {
  const all = Object.values(lines).filter(Boolean);
  const sets = [mesh && placesOf(mesh), points && (mesh ? bulk : placesOf)(points)].filter((places) => places?.length);
  if (!mesh) sets.push(...all.map(placesOf));
  const boxes = sets.map(boxOf), join = (k, side) => side(...boxes.map((box) => (side === Math.min ? box.low : box.high)[k]));
  const low = [0, 1, 2].map((k) => (boxes.length ? join(k, Math.min) : -1));
  const high = [0, 1, 2].map((k) => (boxes.length ? join(k, Math.max) : 1));
  const centre = low.map((x, k) => (x + high[k]) / 2), diagonal = across({ low, high });
  let reach = diagonal / 2;
  for (const set of [mesh, points, ...all]) {
    const p = set?.positions ?? [];
    for (let i = 0; i + 2 < p.length; i += 3) {
      const r = Math.hypot(p[i] - centre[0], p[i + 1] - centre[1], p[i + 2] - centre[2]);
      if (r > reach) reach = r;
    }
  }
  // Some thousand places of each, relative to the centre.
  const some = (places) => places.filter((_, i) => i % Math.max(1, Math.floor(places.length / 4000)) === 0);
  const outline = sets.flatMap(some).map((p) => p.map((x, k) => x - centre[k]));
  return { low, high, centre, diagonal, size: mesh ? across(boxes[0]) : diagonal, reach, outline };
}

// The places of a set, without the points that are not used.
function placesOf({ positions, state }) {
  const found = [];
  for (let i = 0; 3 * i + 2 < positions.length; i++) {
    if (!(state?.[i] >= UNUSED)) found.push([positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]]);
  }
  return found;
}

// Beside a surface the few points that lie far from most others do not count, or the surface would shrink to a dot.
function bulk(points) {
  const places = placesOf(points), ends = [0, 1, 2].map((k) => {
    const sorted = Float32Array.from(places, (p) => p[k]).sort(), few = Math.floor(0.02 * sorted.length);
    return [sorted[few], sorted[sorted.length - 1 - few]];
  });
  const wide = Math.hypot(...ends.map(([a, b]) => b - a));
  return places.filter((p) => p.every((x, k) => x >= ends[k][0] - wide && x <= ends[k][1] + wide));
}

function boxOf(places) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const p of places) for (let k = 0; k < 3; k++) {
    if (p[k] < low[k]) low[k] = p[k];
    if (p[k] > high[k]) high[k] = p[k];
  }
  return { low, high };
}

// The diagonal of a box; 1 of a single place.
const across = ({ low, high }) => Math.hypot(...low.map((x, k) => high[k] - x)) || 1;

// The value that the share `q` of the finite magnitudes does not exceed.
function magnitude(values, q) {
  const found = Float32Array.from(values, Math.abs).filter(Number.isFinite).sort();
  return found.length ? found[Math.min(found.length - 1, Math.floor(q * found.length))] : 0;
}
