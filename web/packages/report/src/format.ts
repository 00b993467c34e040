// Numbers as people read them: a true minus, thin spaces between thousands, as many digits as mean something.

import { finite, type ShownUnit } from "./data";

/** Thin spaces between thousands. */
export function grouped(digits: string): string {
  const [whole, part] = digits.split(".") as [string, string?];
  const spaced = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  return part === undefined ? spaced : `${spaced}.${part}`;
}

function signed(x: number, text: string, plus: boolean): string {
  return (x < 0 ? "\u2212" : plus && x > 0 ? "+" : "") + text;
}

/** How a number is written; with a plus where it is positive, if asked for. */
export type Form = (x: number | null | undefined, plus?: boolean) => string;

/** Writes numbers so that `digits` digits remain of one as large as `reference`; all of a table align. */
export function formatter(reference: number, digits = 3): Form {
  const size = Math.floor(Math.log10(Math.abs(reference) || 1));
  const decimals = Math.max(0, digits - 1 - size);
  return (x, plus = false) => {
    if (!finite(x)) return "–";
    const a = Math.abs(x);
    if (decimals > 8 || a >= 1e9) return a === 0 ? "0" : signed(x, exponential(a, digits), plus);
    const text = a.toFixed(decimals);
    return signed(Number(text) === 0 ? 0 : x, grouped(text), plus);
  };
}

function exponential(a: number, digits: number): string {
  const [m, e] = a.toExponential(digits - 1).split("e");
  return `${m}e${e.replace("+", "").replace("-", "\u2212")}`;
}

export const count = (n: number | null | undefined): string => (finite(n) ? grouped(String(n)) : "–");

/** A share as the messages have it: three digits; near 100 % as many as keep it apart from that, and never rounded up to it. */
export function percent(x: number | null | undefined): string {
  if (!finite(x)) return "–";
  const value = 100 * x, missing = 100 - value;
  if (value < 90 || missing < 1e-10) return `${exact(value, 3)} %`;
  const step = Math.min(10 ** (Math.floor(Math.log10(missing)) - 1), 0.1);
  return `${exact(100 - Math.ceil(missing / step - 1e-6) * step, 12)} %`;
}

/** A number as it was given, or to so many significant digits where it has more; never less than its whole part. */
export function exact(x: number, digits = 5, plus = false): string {
  if (!Number.isFinite(x)) return "–";
  const a = Math.abs(x);
  if (a > 0 && a < 1e-6) return signed(x, exponential(a, digits), plus);
  const whole = Math.min(Math.floor(Math.log10(a || 1)) + 1, 21);
  return signed(x, grouped(String(Number(a.toPrecision(Math.max(digits, whole))))), plus);
}

/** The unit for lengths of one size: `factor` of it are one unit of the file. */
function unitFor(units: ShownUnit[], x: number): ShownUnit {
  const reached = Math.abs(x) * (1 + 5e-4);
  return units.filter(({ from }) => from <= reached).pop() ?? units[0];
}

/** How lengths are written; the viewer needs some of it. */
export interface Lengths {
  /** Where many stand together they are in one unit, `factor` of which are one of the file's. */
  unit: string;
  factor: number;
  aligned: Form;
  withUnit: (x: number, plus?: boolean) => string;
  /** By itself: in the unit that fits it, with three digits as in the messages, or with as many as it has. */
  alone: (x: number, plus?: boolean, digits?: number) => string;
  size: (sizes: number[]) => string;
  /** The largest length up to x that is 1, 2 or 5 times a power of ten of the unit it is shown in. */
  round: (x: number) => number;
}

/** How lengths are written. `units` are those of the page's data. Where many stand together they are in one `unit`, `factor`
// of which are one of the file's, with the decimals of `reference`. */
export function lengthsLike(units: ShownUnit[], reference: number): Lengths {
  const { factor, symbol: unit } = unitFor(units, reference), form = formatter(factor * reference, 3);
  const named = (text: string, symbol: string): string => (symbol ? `${text} ${symbol}` : text);
  const aligned: Form = (x, plus) => form(finite(x) ? factor * x : x, plus);
  return {
    unit, factor, aligned,
    withUnit: (x, plus) => named(aligned(x, plus), unit),
    alone: (x, plus, digits = 3) => {
      const own = unitFor(units, x);
      return named(exact(Number.isFinite(x) ? own.factor * x : NaN, digits, plus), own.symbol);
    },
    size: (sizes) => {
      const own = unitFor(units, Math.max(...sizes));
      return named(sizes.map((x) => exact(own.factor * x, 3)).join(" × "), own.symbol);
    },
    round: (x) => {
      const own = unitFor(units, x);
      return nice(own.factor * x) / own.factor;
    },
  };
}

/** Writes the multiples of a step. */
export const stepped = (step: number): Form => formatter(step, 1);

/** The largest of 1, 2, 5 times a power of ten that is not above x. */
export function nice(x: number): number {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * ([5, 2, 1].find((m) => m * power <= x * (1 + 1e-9)) ?? 1);
}

/** Zero where numbers can have no steps between them: there is no range, or it is lost in their rounding. */
export function tickStep(low: number, high: number, about: number): number {
  const wide = high - low, fine = nice(wide / about), step = wide / fine > 1.5 * about ? 2 * fine : fine;
  return wide > 1e-13 * Math.max(Math.abs(low), Math.abs(high)) && step > 0 && Number.isFinite(step) ? step : 0;
}

/** The multiples of the step from low to high; without a step the one number that there is, if it is one. */
export function ticks(low: number, high: number, about: number): number[] {
  const step = tickStep(low, high, about);
  if (!step) return Number.isFinite(low) && low <= high ? [low] : [];
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => (first + k) * step);
}
