// What people put on the view: distances between two places, and notes at places. They are kept in a copy of the page.

const markName = (k) => String.fromCharCode(65 + (k % 26)) + (k >= 26 ? Math.floor(k / 26) : "");

class Marks {
  // `said(text)` tells what happened, `moved()` has the view drawn again.
  constructor(data, lengths, { moved, said }) {
    Object.assign(this, { data, lengths, moved, said });
    this.tool = null;
    this.first = null; // of the two places of a distance
    const kept = document.getElementById("kept").textContent;
    this.items = (kept.trim() ? JSON.parse(kept) : []).filter((item) => item?.points?.length);
    this.list = document.getElementById("marks");
    for (const name of ["distance", "note"]) document.getElementById(name).addEventListener("click", () => this.choose(this.tool === name ? null : name));
    this.write();
  }

  choose(tool) {
    this.tool = tool;
    this.first = null;
    for (const name of ["distance", "note"]) document.getElementById(name).setAttribute("aria-pressed", tool === name);
    document.getElementById("canvas").classList.toggle("aiming", !!tool);
    document.getElementById("tool-help").textContent = { distance: "Click two places of the surface or points.", note: "Click a place for the note." }[tool] ?? "";
    this.moved();
  }

  // A click on what was found there; whether a tool took it.
  tap(found) {
    if (!this.tool) return false;
    if (!found) {
      this.said("There is nothing here.");
      return true;
    }
    const place = found.position;
    if (this.tool === "note") {
      this.items.push({ kind: "note", points: [place], text: "" });
      this.choose(null);
      this.write();
      this.list.querySelector("li:last-child textarea")?.focus();
    } else if (!this.first) {
      this.first = place;
      this.said("First place taken; click the second.");
    } else {
      const item = { kind: "distance", points: [this.first, place] };
      this.items.push(item);
      this.first = null;
      this.said(`Distance ${this.lengths.alone(this.distance(item))}`);
      this.write();
    }
    this.moved();
    return true;
  }

  distance({ points: [a, b] }) { return Math.hypot(...sub(b, a)); }

  // The words of a mark in the view.
  label(item, k) {
    if (item.kind === "distance") return this.lengths.alone(this.distance(item));
    return `${markName(k)}${item.text ? `: ${item.text.length > 40 ? `${item.text.slice(0, 39)}…` : item.text}` : ""}`;
  }

  // The list beneath the view.
  write() {
    const { lengths, data } = this, place = formatter(data.bounds.diagonal, 6);
    const of = (p) => p.map((x) => place(x)).join(", ");
    this.list.hidden = !this.items.length;
    this.list.replaceChildren(...this.items.map((item, k) => {
      const remove = element("button", { type: "button", "aria-label": `Remove ${markName(k)}`, onclick: () => { this.items.splice(k, 1); this.write(); this.moved(); } }, "remove");
      if (item.kind === "distance") {
        const [a, b] = item.points, parts = sub(b, a).map((x, i) => `${"xyz"[i]} ${lengths.alone(x, true)}`).join(", ");
        return element("li", {}, element("b", {}, `${markName(k)} `), element("span", {}, `${lengths.alone(this.distance(item), false, 5)} `),
          element("span", { class: "quiet" }, `${parts}; from (${of(a)}) to (${of(b)}) ${data.unit}`), " ", remove);
      }
      const area = element("textarea", { rows: 1, "aria-label": `Note ${markName(k)}`, placeholder: "What is there?", maxlength: 500, oninput: (e) => { item.text = e.target.value; this.moved(); } });
      area.value = item.text;
      return element("li", {}, element("b", {}, `${markName(k)} `), area, element("span", { class: "paper" }, ""), element("span", { class: "quiet" }, ` at (${of(item.points[0])}) ${data.unit}`), " ", remove);
    }));
  }

  // The texts for paper, where there are no fields.
  print() {
    this.list.querySelectorAll("li").forEach((line, k) => { const paper = line.querySelector(".paper"); if (paper) paper.textContent = this.items[k].text; });
  }
}
