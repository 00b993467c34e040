// Colour maps: a value on a scale to a colour, with colours of their own for what lies outside and for no data.

/** A colour, each part from 0 to 1. */
export type Colour = [number, number, number];

/** Names of the maps. */
export type MapName = "diverging" | "jet" | "tolerance" | "height";

/** How values become colours. */
export interface Scale {
  map: MapName;
  /** The range of values that the map covers. */
  low: number;
  high: number;
  /** The tolerance, of the map `tolerance`; that map has steps at -band and +band. */
  band?: number;
}

type Stops = readonly [string, string, ...string[]];

const STOPS: Record<MapName, Stops> = {
  // Blue and red differ to every kind of colour vision; both ends darken, so that the eye reads the size first.
  diverging: ["#0b2a66", "#2767b1", "#7fb4e0", "#f7f7f4", "#f4a97c", "#cf5235", "#741019"],
  jet: ["#000080", "#0000ff", "#0080ff", "#00ffff", "#80ff80", "#ffff00", "#ff8000", "#ff0000", "#800000"],
  // Green within the tolerance, from yellowish outside to bluish inside; alarm colours beyond it: `PARTS` are the three parts.
  tolerance: [
    "#5a1190", "#2437c4", "#2f8bff", "#157a64", "#5dbd94", "#c3e8b9", "#a3cf6c", "#5a961c", "#ffa62b", "#dd3a1c", "#7d0a1d",
  ],
  height: ["#4b45a6", "#2f68a8", "#23868c", "#3eb17a", "#a5d25a", "#f3e86b"],
};
/** The parts of the map of the tolerance, each by its own stops. */
const PARTS = {
  below: STOPS.tolerance.slice(0, 3) as unknown as Stops,
  within: STOPS.tolerance.slice(3, 8) as unknown as Stops,
  above: STOPS.tolerance.slice(8) as unknown as Stops,
};
export const MAPS = Object.keys(STOPS) as MapName[];

/** Below and above the scale: bright where its ends are dark. */
export const BEYOND: Record<MapName, { below: string; above: string }> = {
  diverging: { below: "#00d8e6", above: "#ffdd00" },
  jet: { below: "#c9b3ff", above: "#ff66e0" },
  tolerance: { below: "#00e5ff", above: "#ff4fd8" },
  height: { below: "#4b45a6", above: "#f3e86b" },
};
/** Where there are no points to compare with, and points that are not used. */
export const NO_DATA = "#8b9097", REJECTED = "#c026d3";

/** The colour of `#rrggbb`. */
export function parse(hex: string): Colour {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255) as Colour;
}

const css = (c: Colour): string => `rgb(${c.map((x) => Math.round(255 * x)).join(" ")})`;

/** The colour of evenly spaced stops at a place from 0 to 1. */
function along(stops: Stops, place: number): Colour {
  const x = Math.min(Math.max(place, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(x), stops.length - 2);
  const a = parse(stops[k] ?? stops[0]), b = parse(stops[k + 1] ?? stops[1]);
  return [0, 1, 2].map((i) => (a[i] ?? 0) + ((b[i] ?? 0) - (a[i] ?? 0)) * (x - k)) as Colour;
}

/** The colour of a map at a place from 0 to 1. */
export const mapAt = (map: MapName, place: number): Colour => along(STOPS[map], place);

/** The colour of a value on a scale, for CSS, as the shaders choose it. */
export function scaleColour({ map, low, high, band }: Scale, value: number): string {
  if (!Number.isFinite(value)) return NO_DATA;
  if (value < low) return BEYOND[map].below;
  if (value > high) return BEYOND[map].above;
  if (band && Math.abs(value) <= band) return css(along(PARTS.within, 0.5 + 0.5 * value / band));
  if (band) {
    const over = Math.min(1, (Math.abs(value) - band) / Math.max(high - band, 1e-30));
    return css(value > 0 ? along(PARTS.above, over) : along(PARTS.below, 1 - over));
  }
  return css(mapAt(map, high > low ? (value - low) / (high - low) : 0.5));
}

/** The stops of a gradient along the scale, as shares of it and colours; the steps at the tolerance are sharp. */
export function gradientOf(scale: Scale): [number, string][] {
  const { low, high, band } = scale, even = Array.from({ length: 33 }, (_, k) => low + (high - low) * k / 32);
  const limits = band ? [-band, band].flatMap((x) => [x * (1 - 1e-9), x * (1 + 1e-9)]) : [];
  const places = [...even, ...limits.filter((x) => x >= low && x <= high)].sort((a, b) => a - b);
  if (!(high > low)) return [[0, scaleColour(scale, low)]];
  return places.map((x) => [(x - low) / (high - low), scaleColour(scale, x)]);
}

/** The scale as a CSS gradient, from low to high. */
export function gradient(scale: Scale): string {
  const stops = gradientOf(scale).map(([share, colour]) => `${colour} ${(100 * share).toFixed(3)}%`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}

/** Texels of a map for the shaders. */
export const TEXELS = 256;

/** `TEXELS` colours. Of the map of the tolerance, texels 0 to 85 are below, 86 to 169 within, the others above. */
export function mapBytes(map: MapName): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(4 * TEXELS);
  const part = (i: number): Colour => {
    if (i < 86) return along(PARTS.below, i / 85);
    return i < 170 ? along(PARTS.within, (i - 86) / 83) : along(PARTS.above, (i - 170) / 85);
  };
  for (let i = 0; i < TEXELS; i++) {
    const colour = map === "tolerance" ? part(i) : mapAt(map, i / (TEXELS - 1));
    bytes.set([...colour, 1].map((x) => Math.round(255 * x)), 4 * i);
  }
  return bytes;
}

/** Symmetric about zero, as far as `most`. */
export function around(most: number): Scale {
  return { map: "diverging", low: -most, high: most };
}

/**
 * The scale for values of any kind: from their 2nd to their 98th percentile, symmetric where they have both signs. Values
 * at singular points, far beyond all others, do not take all colours.
 */
export function spread(values: ArrayLike<number>): Scale {
  const step = Math.max(1, Math.floor(values.length / 50_000));
  const some: number[] = [];
  for (let k = 0; k < values.length; k += step) {
    const value = values[k];
    if (value !== undefined && Number.isFinite(value)) some.push(value);
  }
  if (some.length === 0) return around(1);
  some.sort((a, b) => a - b);
  const percentile = (share: number): number => some[Math.min(some.length - 1, Math.floor(share * some.length))] ?? 0;
  const low = percentile(0.02), high = percentile(0.98);
  if (low < 0 && high > 0) return around(Math.max(-low, high));
  return high > low ? { map: "diverging", low, high } : { map: "diverging", low: low - 1e-12, high: high + 1e-12 };
}

/** How the faces at an edge join; angles between their normals in degrees. */
export interface Join {
  kind: string | null;
  sampled: number | null;
  bound: number | null;
}

/** Classes of the angle at smooth edges, in degrees: upper limits and colours. 0.1 and 0.5 are the limits of the check. */
export const JUMPS: readonly [number, string][] = [
  [0.01, "#1f78b4"], [0.05, "#33b3c9"], [0.1, "#8fd175"], [0.5, "#ffb000"], [1, "#f0561d"], [Infinity, "#b0003a"],
];
/** The bound of the angle, or the largest sample where there is none; NaN where nothing was measured. */
export const jumpOf = (join: Join): number => join.bound ?? join.sampled ?? NaN;
export const jumpClass = (join: Join): number => JUMPS.findIndex(([limit]) => jumpOf(join) <= limit);
