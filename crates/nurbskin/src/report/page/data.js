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
  for (const list of ["inputs", "tables", "worst", "faces", "poles"]) data[list] ||= [];
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

// What the view is fitted to (rejected points do not count), and `reach`: the radius that holds all that is drawn.
function boundsOf(data) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const grow = (positions, used) => {
    for (let i = 0; i < positions.length; i++) {
      if (used && !used(Math.floor(i / 3))) continue;
      const x = positions[i], k = i % 3;
      if (x < low[k]) low[k] = x;
      if (x > high[k]) high[k] = x;
    }
  };
  if (data.mesh) grow(data.mesh.positions);
  else if (data.points) grow(data.points.positions, (i) => data.points.state[i] !== 3);
  for (const line of Object.values(data.lines)) if (line && !data.mesh) grow(line.positions);
  for (let k = 0; k < 3; k++) if (!(low[k] <= high[k])) [low[k], high[k]] = [-1, 1];
  const centre = low.map((x, k) => (x + high[k]) / 2);
  const diagonal = Math.hypot(...low.map((x, k) => high[k] - x)) || 1;
  let reach = diagonal / 2;
  for (const set of [data.points, ...Object.values(data.lines)]) {
    const p = set?.positions ?? [];
    for (let i = 0; i + 2 < p.length; i += 3) {
      const r = Math.hypot(p[i] - centre[0], p[i + 1] - centre[1], p[i + 2] - centre[2]);
      if (r > reach) reach = r;
    }
  }
  return { low, high, centre, diagonal, reach, outline: outlineOf(data, centre) };
}

// Some thousand places of what the view is fitted to, relative to the centre.
function outlineOf({ mesh, points, lines }, centre) {
  const set = mesh ?? points ?? Object.values(lines).find(Boolean), found = [];
  const total = (set?.positions.length ?? 0) / 3, step = Math.max(1, Math.floor(total / 4000));
  for (let i = 0; i < total; i += step) {
    if (!mesh && set.state?.[i] === 3) continue;
    found.push([0, 1, 2].map((k) => set.positions[3 * i + k] - centre[k]));
  }
  return found;
}

// The value that the share `q` of the finite magnitudes does not exceed.
function magnitude(values, q) {
  const found = Float32Array.from(values, Math.abs).filter(Number.isFinite).sort();
  return found.length ? found[Math.min(found.length - 1, Math.floor(q * found.length))] : 0;
}
