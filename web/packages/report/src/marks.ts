// What people put on the view: distances between two places, and notes at places. They are kept in a copy of the page.

import { size, sub, type Mark, type Vector } from "nurbskin-viewer";
import type { Data } from "./data";
import { byId, element } from "./dom";
import { formatter, type Lengths } from "./format";

/** In the coordinates of the file: a note has one place, a distance two. */
export type Item = { kind: "note"; points: [Vector]; text: string } | { kind: "distance"; points: [Vector, Vector] };
type Tool = Item["kind"];

/** A to Z, then A1 and so on. */
const markName = (k: number): string => String.fromCharCode(65 + (k % 26)) + (k >= 26 ? String(Math.floor(k / 26)) : "");

/** Most letters of a note in the view. */
const MOST_LETTERS = 40;
const HELP: Record<Tool, string> = { distance: "Click two places of the surface or points.", note: "Click a place for the note." };

export class Marks {
  items: Item[];
  tool: Tool | null = null;
  /** The first place of a distance. */
  first: Vector | null = null;
  private readonly list = byId("marks");

  /** `said(text)` tells what happened, `moved()` has the view drawn again. */
  constructor(private readonly data: Data, private readonly lengths: Lengths,
    private readonly told: { moved: () => void; said: (text: string) => void }) {
    const kept = byId("kept").textContent;
    this.items = kept.trim() ? JSON.parse(kept) as Item[] : [];
    for (const name of ["distance", "note"] as const) {
      byId(name).addEventListener("click", () => { this.choose(this.tool === name ? null : name); });
    }
    this.write();
  }

  choose(tool: Tool | null): void {
    this.tool = tool;
    this.first = null;
    for (const name of ["distance", "note"]) byId(name).setAttribute("aria-pressed", String(tool === name));
    byId("canvas").classList.toggle("aiming", !!tool);
    byId("tool-help").textContent = tool ? HELP[tool] : "";
    this.told.moved();
  }

  /** A click on a place, or on nothing; whether a tool took it. */
  tap(place: Vector | null): boolean {
    if (!this.tool) return false;
    if (!place) {
      this.told.said("There is nothing here.");
      return true;
    }
    if (this.tool === "note") {
      this.items.push({ kind: "note", points: [place], text: "" });
      this.choose(null);
      this.write();
      this.list.querySelector<HTMLElement>("li:last-child textarea")?.focus();
    } else if (!this.first) {
      this.first = place;
      this.told.said("First place taken; click the second.");
    } else {
      const points: [Vector, Vector] = [this.first, place];
      this.items.push({ kind: "distance", points });
      this.first = null;
      this.told.said(`Distance ${this.lengths.alone(far(points))}`);
      this.write();
    }
    this.told.moved();
    return true;
  }

  /** As the view draws them. */
  shown(): Mark[] {
    const local = (p: Vector): Vector => sub(p, this.data.origin);
    const found = this.items.map((item, k) => {
      const distance = item.kind === "distance";
      return { points: item.points.map(local), label: this.label(item, k), distance };
    });
    return this.first ? [...found, { points: [local(this.first)], label: "from here", distance: false }] : found;
  }

  /** The texts for paper, where there are no fields. */
  print(): void {
    this.list.querySelectorAll("li").forEach((line, k) => {
      const paper = line.querySelector(".paper"), item = this.items[k];
      if (paper && item.kind === "note") paper.textContent = item.text;
    });
  }

  private label(item: Item, k: number): string {
    if (item.kind === "distance") return this.lengths.alone(far(item.points));
    const text = item.text.length > MOST_LETTERS ? `${item.text.slice(0, MOST_LETTERS - 1)}…` : item.text;
    return `${markName(k)}${text ? `: ${text}` : ""}`;
  }

  /** The list beneath the view. */
  private write(): void {
    const { lengths, data } = this, place = formatter(data.bounds.diagonal, 6);
    const of = (p: Vector): string => p.map((x) => place(x)).join(", ");
    this.list.hidden = !this.items.length;
    this.list.replaceChildren(...this.items.map((item, k) => {
      const name = element("b", {}, `${markName(k)} `);
      const without = (): void => { this.items.splice(k, 1); this.write(); this.told.moved(); };
      const remove = element("button", { type: "button", "aria-label": `Remove ${markName(k)}`, onclick: without }, "remove");
      if (item.kind === "distance") {
        const [a, b] = item.points, parts = sub(b, a).map((x, i) => `${"xyz".charAt(i)} ${lengths.alone(x, true)}`).join(", ");
        return element("li", {}, name, element("span", {}, `${lengths.alone(far(item.points), false, 5)} `),
          element("span", { class: "quiet" }, `${parts}; from (${of(a)}) to (${of(b)}) ${data.unit}`), " ", remove);
      }
      const attributes = { rows: 1, "aria-label": `Note ${markName(k)}`, placeholder: "What is there?", maxlength: 500 };
      const area = element("textarea", attributes);
      area.value = item.text;
      area.addEventListener("input", () => { item.text = area.value; this.told.moved(); });
      return element("li", {}, name, area, element("span", { class: "paper" }),
        element("span", { class: "quiet" }, ` at (${of(item.points[0])}) ${data.unit}`), " ", remove);
    }));
  }
}

const far = ([a, b]: [Vector, Vector]): number => size(sub(b, a));
