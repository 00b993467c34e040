// Colour maps, as 256 colours from the low to the high end of a scale, and what lies outside them.

const STOPS = {
  // Blue and red differ to every kind of colour vision; both ends darken, so that the eye reads the size first.
  diverging: ["#0b2a66", "#2767b1", "#7fb4e0", "#f7f7f4", "#f4a97c", "#cf5235", "#741019"],
  jet: ["#000080", "#0000ff", "#0080ff", "#00ffff", "#80ff80", "#ffff00", "#ff8000", "#ff0000", "#800000"],
  // Green within the tolerance, from yellowish outside to bluish inside; alarm colours beyond it: `tolerance` has the three parts.
  tolerance: ["#5a1190", "#2437c4", "#2f8bff", "#157a64", "#5dbd94", "#c3e8b9", "#a3cf6c", "#5a961c", "#ffa62b", "#dd3a1c", "#7d0a1d"],
  height: ["#4b45a6", "#2f68a8", "#23868c", "#3eb17a", "#a5d25a", "#f3e86b"],
};
// Off the scale: bright where the ends of the scale are dark.
const BEYOND = {
  diverging: { below: "#00d8e6", above: "#ffdd00" },
  jet: { below: "#c9b3ff", above: "#ff66e0" },
  tolerance: { below: "#00e5ff", above: "#ff4fd8" },
  height: { below: "#4b45a6", above: "#f3e86b" },
};
const NO_DATA = "#8b9097", REJECTED = "#c026d3";

const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
const css = (c) => `rgb(${c.map((x) => Math.round(255 * x)).join(" ")})`;

// The colour of a map at t in 0..=1.
function mapAt(name, t) {
  const stops = STOPS[name], x = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(x), stops.length - 2);
  const a = rgb(stops[k]), b = rgb(stops[k + 1]);
  return a.map((v, i) => v + (b[i] - v) * (x - k));
}

// The parts of the map of the tolerance, each by its own stops: below, within, above.
const PARTS = [[0, 3], [3, 8], [8, 11]].map(([a, b]) => STOPS.tolerance.slice(a, b));
STOPS.below = PARTS[0], STOPS.within = PARTS[1], STOPS.above = PARTS[2];

// The colour of a value on the scale { map, low, high, band }, as the shaders choose it. `band` is the tolerance of a map that has it.
function scaleColour({ map, low, high, band }, value) {
  if (!Number.isFinite(value)) return NO_DATA;
  if (value < low) return BEYOND[map].below;
  if (value > high) return BEYOND[map].above;
  if (band && Math.abs(value) <= band) return css(mapAt("within", 0.5 + 0.5 * value / band));
  if (band) {
    const over = Math.min(1, (Math.abs(value) - band) / Math.max(high - band, 1e-30));
    return css(value > 0 ? mapAt("above", over) : mapAt("below", 1 - over));
  }
  return css(mapAt(map, high > low ? (value - low) / (high - low) : 0.5));
}

// The stops of a gradient along the scale, as shares of it and colours; the steps at the tolerance are sharp.
function gradientOf(scale) {
  const { low, high, band } = scale, even = Array.from({ length: 33 }, (_, k) => low + (high - low) * k / 32);
  const limits = band ? [-band, band].flatMap((x) => [x * (1 - 1e-9), x * (1 + 1e-9)]) : [];
  const at = [...even, ...limits.filter((x) => x >= low && x <= high)].sort((a, b) => a - b);
  if (!(high > low)) return [[0, scaleColour(scale, low)]];
  return at.map((x) => [(x - low) / (high - low), scaleColour(scale, x)]);
}

// 256 colours. Of the map of the tolerance, texels 0 to 85 are below, 86 to 169 within, the others above.
function mapBytes(name) {
  const bytes = new Uint8Array(4 * 256);
  const at = (i) => (i < 86 ? mapAt("below", i / 85) : i < 170 ? mapAt("within", (i - 86) / 83) : mapAt("above", (i - 170) / 85));
  for (let i = 0; i < 256; i++) bytes.set([...(name === "tolerance" ? at(i) : mapAt(name, i / 255)), 1].map((x) => Math.round(255 * x)), 4 * i);
  return bytes;
}

// Angles between normals at smooth edges, in degrees: the upper limits of classes and their colours. 0.1 and 0.5 are the limits of the check.
const JUMPS = [[0.01, "#1f78b4"], [0.05, "#33b3c9"], [0.1, "#8fd175"], [0.5, "#ffb000"], [1, "#f0561d"], [Infinity, "#b0003a"]];
const jumpOf = (join) => join.bound ?? join.sampled;
const jumpClass = (join) => JUMPS.findIndex(([limit]) => jumpOf(join) <= limit);
