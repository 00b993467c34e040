// Colour maps, as 256 colours from the low to the high end of a scale, and what lies outside them.

const STOPS = {
  // Blue and red differ to every kind of colour vision; both ends darken, so that the eye reads the size first.
  diverging: ["#0b2a66", "#2767b1", "#7fb4e0", "#f7f7f4", "#f4a97c", "#cf5235", "#741019"],
  jet: ["#000080", "#0000ff", "#0080ff", "#00ffff", "#80ff80", "#ffff00", "#ff8000", "#ff0000", "#800000"],
  height: ["#4b45a6", "#2f68a8", "#23868c", "#3eb17a", "#a5d25a", "#f3e86b"],
};
// Off the scale: bright where the ends of the scale are dark.
const BEYOND = {
  diverging: { below: "#00d8e6", above: "#ffdd00" },
  jet: { below: "#c9b3ff", above: "#ff66e0" },
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

// The colour of a value on the scale { map, low, high }, as the shaders choose it.
function scaleColour(scale, value) {
  if (!Number.isFinite(value)) return NO_DATA;
  if (value < scale.low) return BEYOND[scale.map].below;
  if (value > scale.high) return BEYOND[scale.map].above;
  return css(mapAt(scale.map, scale.high > scale.low ? (value - scale.low) / (scale.high - scale.low) : 0.5));
}

function mapBytes(name) {
  const bytes = new Uint8Array(4 * 256);
  for (let i = 0; i < 256; i++) bytes.set([...mapAt(name, i / 255), 1].map((x) => Math.round(255 * x)), 4 * i);
  return bytes;
}
