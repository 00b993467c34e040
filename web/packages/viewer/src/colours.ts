// Colour maps: a value on a scale to a colour, with colours of their own for what lies outside and for no data.

/** A colour, each part from 0 to 1. */
export type Colour = [number, number, number];

/** The range of values that a map covers. */
export interface Scale {
  low: number;
  high: number;
}

// Blue and red differ to every kind of colour vision; both ends darken, so that the eye reads the size first. The same
// colours as in the report.
const STOPS = ["#0b2a66", "#2767b1", "#7fb4e0", "#f7f7f4", "#f4a97c", "#cf5235", "#741019"];
/** Below and above the scale: bright where its ends are dark. */
export const BEYOND = { below: "#00d8e6", above: "#ffdd00" };
/** Where there are no points to compare with. */
export const NO_DATA = "#8b9097";

/** The colour of `#rrggbb`. */
export function parse(hex: string): Colour {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255) as Colour;
}

const stops = STOPS.map(parse);
const [below, above, noData] = [BEYOND.below, BEYOND.above, NO_DATA].map(parse) as [Colour, Colour, Colour];

/** The colour of the map at a place from 0 to 1. */
export function mapAt(place: number): Colour {
  const x = Math.min(Math.max(place, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(x), stops.length - 2);
  const a = stops[k] ?? noData, b = stops[k + 1] ?? noData;
  return a.map((v, i) => v + ((b[i] ?? v) - v) * (x - k)) as Colour;
}

/** The colour of a value on a scale. */
export function colourOf(scale: Scale, value: number): Colour {
  if (!Number.isFinite(value)) return noData;
  if (value < scale.low) return below;
  if (value > scale.high) return above;
  return mapAt(scale.high > scale.low ? (value - scale.low) / (scale.high - scale.low) : 0.5);
}

/** The map as a CSS gradient, from low to high. */
export const GRADIENT = `linear-gradient(to right, ${STOPS.join(", ")})`;

/** Symmetric about zero, as far as `most`. */
export function around(most: number): Scale {
  return { low: -most, high: most };
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
  const at = (share: number): number => some[Math.min(some.length - 1, Math.floor(share * some.length))] ?? 0;
  const low = at(0.02), high = at(0.98);
  if (low < 0 && high > 0) return around(Math.max(-low, high));
  return high > low ? { low, high } : { low: low - 1e-12, high: high + 1e-12 };
}

/** One colour per value, as bytes (red, green, blue). */
export function coloursOf(values: ArrayLike<number>, scale: Scale): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(3 * values.length);
  for (let k = 0; k < values.length; k++) {
    const [r, g, b] = colourOf(scale, values[k] ?? NaN);
    bytes[3 * k] = Math.round(255 * r);
    bytes[3 * k + 1] = Math.round(255 * g);
    bytes[3 * k + 2] = Math.round(255 * b);
  }
  return bytes;
}
