// Checks parts of the pages that need no browser: packed lists, colours by the tolerance, sections, classes of angles.
//
//   node parts.mjs

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { deflateRawSync } from "node:zlib";

const names = ["data", "format", "colours", "camera", "charts", "section"];
const source = names.map((name) => readFileSync(new URL(`../../crates/nurbskin/src/report/page/${name}.js`, import.meta.url), "utf8")).join("\n");
const { unpack, unpackDirections, scaleColour, gradientOf, jumpClass, cropped, cutMesh, rangeAlong, alongCut, magnification } = new Function(
  `${source}; return { unpack, unpackDirections, scaleColour, gradientOf, jumpClass, cropped, cutMesh, rangeAlong, alongCut, magnification };`)();

// As packed.rs writes them: differences, zigzag, planes of bytes.
function packed(values, width, order, step) {
  const at = (k, back) => (k - back * width < 0 ? 0 : values[k - back * width]);
  const rest = values.map((x, k) => (x - (order === 0 ? 0 : order === 1 ? at(k, 1) : 2 * at(k, 1) - at(k, 2))) | 0).map((r) => (r << 1 ^ r >> 31) >>> 0);
  const planes = Uint8Array.from([0, 8, 16, 24].flatMap((shift) => rest.map((z) => z >>> shift & 255)));
  return { count: values.length / width, width, order, step, deflate: deflateRawSync(planes).toString("base64") };
}
const whole = [5, -7, 2 ** 31 - 2, -(2 ** 31) + 1, 0, 1, 2, 3, 1e6, -1e6];
for (const order of [0, 1, 2]) for (const width of [1, 2]) {
  assert.deepEqual([...await unpack(packed(whole, width, order, 0), Int32Array)], whole);
  assert.deepEqual([...await unpack(packed([1, -(2 ** 31), 3, 4], width, order, 0.5), Float64Array)], [0.5, NaN, 1.5, 2]);
}
assert.equal(await unpack(packed([], 3, 0, 1), Float32Array), null);
assert.equal(await unpack(undefined, Float32Array), null);
const directions = await unpackDirections(packed([1, 0, 0, 0, 0, -1, 1, 1], 2, 1, 1));
[[1, 0, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1]].forEach((n, k) => n.forEach((x, i) => assert(Math.abs(directions[3 * k + i] - x) < 1e-6, `${directions}`)));

// Green within the tolerance, other colours beyond it, whatever the range.
const green = (colour) => { const [r, g, b] = colour.match(/\d+/g).map(Number); return g > r && g > b; };
for (const high of [1, 1.5, 40]) {
  const scale = { map: "tolerance", low: -high, high, band: 1 };
  for (const x of [-1, -0.999, -0.5, -1e-9, 0, 0.3, 0.9, 1]) assert(green(scaleColour(scale, x)), `${x} of ${high}: ${scaleColour(scale, x)}`);
  for (const x of [-1.001, 1.001, 1.2, -high, high].filter((x) => Math.abs(x) > 1 && Math.abs(x) <= high)) assert(!green(scaleColour(scale, x)), `${x} of ${high}`);
  assert.deepEqual([scaleColour(scale, 2 * high), scaleColour(scale, -2 * high)], ["#ff4fd8", "#00e5ff"]);
  const stops = gradientOf(scale);
  assert(stops.every(([at], k) => at >= 0 && at <= 1 && (!k || at >= stops[k - 1][0])), "stops are in order");
}
assert.equal(scaleColour({ map: "diverging", low: -1, high: 1 }, NaN), "#8b9097");

assert.deepEqual([0, 0.01, 0.0100001, 0.1, 0.3, 0.5, 0.9, 7].map((bound) => jumpClass({ bound })), [0, 0, 1, 2, 3, 3, 4, 5]);
assert.equal(jumpClass({ bound: null, sampled: 0.02 }), 1);

const histogram = { low: -5.5, high: 5.5, counts: [1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1], below: 7, above: 8 }, part = cropped(histogram, 2.6);
assert.deepEqual([part.counts, part.below, part.above], [[3, 4, 5, 6, 5, 4, 3], 10, 11]);
assert(Math.abs(part.low + 3.5) < 1e-12 && Math.abs(part.high - 3.5) < 1e-12);
assert.deepEqual(cropped(histogram, 100).counts, histogram.counts);

// A sphere of triangles: each section is a closed circle of the radius that it should have.
const n = 40, positions = [], triangles = [];
for (let j = 0; j <= n; j++) for (let i = 0; i < 2 * n; i++) {
  const [a, b] = [Math.PI * j / n, Math.PI * i / n];
  positions.push(10 * Math.sin(a) * Math.cos(b), 10 * Math.sin(a) * Math.sin(b), 10 * Math.cos(a));
  if (j < n) { const k = (m, l) => l * 2 * n + (m % (2 * n)); triangles.push(k(i, j), k(i, j + 1), k(i + 1, j), k(i + 1, j), k(i, j + 1), k(i + 1, j + 1)); }
}
const mesh = { positions: Float64Array.from(positions), triangles: Uint32Array.from(triangles), normals: Float64Array.from(positions, (x) => x / 10), deviation: Float64Array.from(positions.filter((_, k) => k % 3 === 2), (z) => 0.01 * z) };
for (const normal of [[1, 0, 0], [0, 0, 1], [0.6, 0, 0.8]]) {
  const [low, high] = rangeAlong(mesh, normal);
  assert(low < -9.9 && high > 9.9 && high <= 10 + 1e-9);
  for (const offset of [-7.013, 0.017, 4.5]) {
    const segments = cutMesh(mesh, normal, offset), { length, mean, bare } = alongCut(segments), radius = Math.sqrt(100 - offset ** 2);
    assert(Math.abs(length / (2 * Math.PI * radius) - 1) < 0.01, `${length} at ${offset}`);
    assert(Math.abs(mean - 0.01 * offset * normal[2]) < 2e-3 && bare === 0, `${mean} at ${offset}`);
    const ends = new Map();
    for (const { point, normal: at } of segments.flat()) {
      assert(Math.abs(point[0] * normal[0] + point[1] * normal[1] + point[2] * normal[2] - offset) < 1e-9);
      assert(at.every((x, k) => Math.abs(x - point[k] / 10) < 1e-9));
      ends.set(point.join(), (ends.get(point.join()) ?? 0) + 1);
    }
    assert([...ends.values()].every((count) => count % 2 === 0), "the curve is closed");
  }
}
assert.equal(cutMesh(mesh, [1, 0, 0], 11).length, 0);
// Deviations of 0.1 are drawn about a fifteenth of a drawing of 20: 10 times enlarged; a tolerance counts, too.
assert.equal(magnification(cutMesh(mesh, [1, 0, 0], 0.017), 20, null), 10);
assert.equal(magnification(cutMesh(mesh, [1, 0, 0], 0.017), 20, 0.5), 2);
assert.equal(magnification([], 20, null), 1);

console.log("ok     packed lists, colours by the tolerance, sections, classes of angles");
