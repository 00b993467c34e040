// The scripts of the page are joined in this order, inside one function: data, format, colours, camera, shaders, scene,
// pick, legend, charts, tables, overlay, view, main.

// The data of the page: JSON with arrays as base64 of little-endian numbers.

function decode(text, Type) {
  if (!text) return null;
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Type(bytes.buffer);
}

function readData() {
  const data = JSON.parse(document.getElementById("data").textContent);
  data.origin ||= [0, 0, 0];
  data.unit ||= "";
  if (!data.shown_in?.length) data.shown_in = [{ from: 0, factor: 1, symbol: data.unit }];
  for (const list of ["inputs", "tables", "details", "worst", "faces", "poles"]) data[list] ||= [];
  data.mesh = readMesh(data.mesh);
  data.points = readPoints(data.points);
  for (const name of ["edges", "seams", "iso_curves", "control_net"]) {
    const line = data.lines?.[name];
    const positions = decode(line?.positions, Float32Array);
    data.lines = { ...data.lines, [name]: positions?.length ? { positions, lengths: line.lengths } : null };
  }
  data.bounds = boundsOf(data);
  return data;
}

function readMesh(mesh) {
  const positions = decode(mesh?.positions, Float32Array), triangles = decode(mesh?.triangles, Uint32Array);
  if (!positions?.length || !triangles?.length) return null;
  return {
    positions, triangles,
    normals: decode(mesh.normals, Float32Array),
    parameters: decode(mesh.parameters, Float32Array),
    faces: decode(mesh.vertex_faces, Uint32Array),
    deviation: decode(mesh.deviation, Float32Array),
    mean: decode(mesh.mean_curvature, Float32Array),
    gaussian: decode(mesh.gaussian_curvature, Float32Array),
  };
}

function readPoints(points) {
  const positions = decode(points?.positions, Float32Array);
  if (!positions?.length) return null;
  const count = positions.length / 3;
  return {
    positions, count,
    total: points.total ?? count,
    deviation: decode(points.deviation, Float32Array),
    index: decode(points.index, Uint32Array),
    parameters: decode(points.parameters, Float32Array),
    faces: decode(points.faces, Uint32Array),
    state: decode(points.state, Uint8Array) ?? new Uint8Array(count),
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

// The places of a set, without rejected points.
function placesOf({ positions, state }) {
  const found = [];
  for (let i = 0; 3 * i + 2 < positions.length; i++) {
    if (state?.[i] !== 3) found.push([positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]]);
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
