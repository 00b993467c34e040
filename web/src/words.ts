// Words and numbers for people.

import type { ShownUnit, UnitName, Verdict } from "nurbskin";
import type { Failure } from "./protocol";

/** The units that can be chosen, in words. */
export const UNITS: { name: UnitName; label: string; millimetres: number }[] = [
  { name: "mm", label: "Millimetres", millimetres: 1 },
  { name: "cm", label: "Centimetres", millimetres: 10 },
  { name: "m", label: "Metres", millimetres: 1000 },
  { name: "um", label: "Micrometres", millimetres: 0.001 },
  { name: "in", label: "Inches", millimetres: 25.4 },
  { name: "ft", label: "Feet", millimetres: 304.8 },
];

const STAGES: Record<string, string> = {
  read: "Reading the file",
  clean: "Cleaning the points",
  order: "Finding the shape",
  align: "Aligning the scan",
  rarefy: "Choosing lines of points",
  enrich: "Filling in points",
  fit: "Fitting the surface",
  approximate: "Fitting the surface",
  simulate: "Scanning the example",
  page: "Preparing the view",
  deviation: "Measuring every point",
  write: "Writing and checking the CAD file",
  check: "Checking the CAD file",
};

/** A stage of the library in words. */
export function stageWords(name: string): string {
  return STAGES[name] ?? name.charAt(0).toUpperCase() + name.slice(1);
}

/** The verdict in words. */
export function verdictWords(verdict: Verdict, kind: "fit" | "compare"): string {
  switch (verdict) {
    case "pass": return "Passed";
    case "fail": return kind === "fit" ? "Not within the limits" : "Not within tolerance";
    case "cannot_tell": return "The scan cannot tell";
    case "not_asked": return kind === "fit" ? "Surface ready" : "Measured";
  }
}

/** Three significant digits, with a true minus. */
export function digits(value: number, count = 3): string {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const whole = Math.floor(Math.log10(size)) + 1;
  if (size >= 1e9 || size < 1e-6) return value.toExponential(count - 1).replace("-", "\u2212").replace("e+", "e");
  const text = whole >= count ? Math.round(size).toString() : Number(size.toPrecision(count)).toString();
  return (value < 0 ? "\u2212" : "") + grouped(text);
}

/** Thin spaces between thousands, from five digits on. */
export function grouped(text: string): string {
  const [whole = "", part] = text.split(".");
  const spaced = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  return part === undefined ? spaced : `${spaced}.${part}`;
}

/** A count with its noun. */
export function counted(count: number, one: string, many: string): string {
  return `${grouped(String(count))} ${count === 1 ? one : many}`;
}

function unitFor(units: ShownUnit[], length: number): ShownUnit | undefined {
  const reached = Math.abs(length) * (1 + 5e-4);
  return units.filter(({ from }) => from <= reached).pop() ?? units[0];
}

/** The largest length up to this one that is 1, 2 or 5 times a power of ten of the unit that it is shown in. */
export function roundLength(units: ShownUnit[], length: number): number {
  const factor = unitFor(units, length)?.factor ?? 1, power = 10 ** Math.floor(Math.log10(factor * length));
  return power * ([5, 2, 1].find((step) => step * power <= factor * length * (1 + 1e-9)) ?? 1) / factor;
}

/** A length of the file in the unit that suits its size; `units` are those of the scene. */
export function lengthWords(units: ShownUnit[], value: number, like = value): string {
  const unit = unitFor(units, like);
  return unit ? `${digits(value * unit.factor)} ${unit.symbol === "um" ? "µm" : unit.symbol}` : digits(value);
}

/** The size of a box whose numbers are in `unit`. */
export function sizeWords(box: [number[], number[]], unit: UnitName): string {
  const sides = box[1].map((high, k) => high - (box[0][k] ?? 0));
  return `${sides.map((side) => digits(side)).join(" × ")} ${unit === "um" ? "µm" : unit}`;
}

/** The size in metric or imperial words that a person can picture, for the choice of a unit. */
export function pictured(box: [number[], number[]], unit: UnitName): string {
  const scale = UNITS.find(({ name }) => name === unit)?.millimetres ?? 1;
  const most = Math.max(...box[1].map((high, k) => high - (box[0][k] ?? 0))) * scale;
  if (most >= 1e6) return `${digits(most / 1e6)} km`;
  if (most >= 1000) return `${digits(most / 1000)} m`;
  if (most < 0.1) return `${digits(most * 1000)} µm`;
  return `${digits(most)} mm`;
}

/** Bytes. */
export function bytesWords(count: number): string {
  if (count < 1000) return `${count} bytes`;
  return count < 1e6 ? `${digits(count / 1e3)} kB` : `${digits(count / 1e6)} MB`;
}

// Sentences of the library name options of the command; on the page there are fields.
const FIELDS: [RegExp, string][] = [
  [/(\d) um\b/g, "$1 µm"],
  [/\+-(?=\d)/g, "±"],
  [/say --align if/g, "align the scan to the CAD file if"],
  [/ ?\((?:say|use) --unit[^)]*\)/g, " (choose it under “Unit”)"],
  [/say (?:the unit, as in )?--unit (\w+)/g, "choose “$1” under “Unit”"],
  [/ ?\(--unit\)/g, ""],
  [/ ?\(-t\)/g, ""],
  [/ ?\(--report part\.html\)/g, ""],
  [/look at the place in the report/g, "look at the marked places"],
  [/ ?\(--trim always[^)]*\)/g, ""],
  [/`?--layout network`?/g, "“Several faces” under “Shape”"],
  [/`?--layout single`?/g, "“One surface” under “Shape”"],
  [/ ?\(--max-control-points\)/g, ""],
  [/-t (\d[\w.]*)/g, "a tolerance of $1"],
  [/or say --min-coverage \S+ if this much is enough/g, "if more is needed"],
  [/without -t and --max-control-points/g, "without a tolerance"],
];

/** A sentence of the library in the words of the page. */
export function plain(sentence: string): string {
  return FIELDS.reduce((text, [from, to]) => text.replace(from, to), sentence);
}

/** With a capital letter, but for the name of a file, and a full stop. */
export function sentence(text: string): string {
  const said = plain(text).trim();
  const word = /^[a-z]+(?=[\s,;:'’]|$)/.test(said);
  return said === "" ? said : (word ? said.charAt(0).toUpperCase() + said.slice(1) : said) + (/[.!?]$/.test(said) ? "" : ".");
}

/** What has failed, and what to do. */
export function failureWords(failure: Failure): string {
  switch (failure.kind) {
    case "memory":
      return "The memory that a web page may use is full. Close other tabs, use fewer points, or use the command on this computer.";
    case "crash":
      return `Something went wrong inside the page (${failure.message}). Please report it with the file; the files and settings are kept.`;
    case "cancelled":
      return "Cancelled. The files and settings are kept.";
    default:
      return sentence(failure.message);
  }
}

/** What a person typed as a tolerance: empty, or a number with a unit; an error in words if it is neither. */
export function readTolerance(number: string, unit: string): { tolerance?: string; error?: string } {
  const text = number.trim().replace(",", ".");
  if (text === "") return {};
  const value = Number(text);
  if (!Number.isFinite(value) || value <= 0) return { error: "Write a number above zero, such as 0.1, or leave the field empty." };
  return { tolerance: `${text}${unit}` };
}
