// The faces and how they join: deviation by face, and the angles between normals at edges.

// A table whose columns sort it: [name, value of a row, text of the value, class].
function sortable(rows, columns, first) {
  let by = first, down = true;
  const made = element("table", { class: "several sorted" }), body = element("tbody"), heads = columns.map(([name, , , kind], k) => element("th", { scope: "col", class: kind },
    element("button", { type: "button", onclick: () => { down = by === k ? !down : true; by = k; fill(); } }, name)));
  function fill() {
    const value = columns[by][1], size = (row) => { const x = value(row); return typeof x === "number" && !Number.isFinite(x) ? -Infinity : x; };
    const order = [...rows].sort((a, b) => { const [x, y] = [size(a), size(b)]; return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1); });
    heads.forEach((head, k) => (k === by ? head.setAttribute("aria-sort", down ? "descending" : "ascending") : head.removeAttribute("aria-sort")));
    body.replaceChildren(...order.map((row) => element("tr", {}, ...columns.map(([, , text, kind], k) => element(k ? "td" : "th", { class: kind, scope: k ? null : "row" }, text(row))))));
  }
  made.append(element("thead", {}, element("tr", {}, ...heads)), body);
  fill();
  return made;
}

// A box that scrolls where a table is long; on paper its first rows are printed.
const long = (made) => element("div", { class: "scroll long" }, made);

const surfaceKind = (f) => String(f.kind ?? "–").replace("b_spline", "B-spline").replace(/_/g, " ");

// Every face with its surface, and its deviation where there is one; `go(k)` when a face is chosen.
function facesTable(faces, lengths, tolerance, go) {
  const rows = faces.map((face, k) => ({ face, k, s: face.deviation })), measured = faces.some((f) => f.deviation);
  const name = ({ face, k }) => element("button", { type: "button", class: "plain", onclick: () => go(k) }, face.name || `face ${k}`);
  const of = lengths.unit ? `, ${lengths.unit}` : "", figure = (key, text) => [(row) => row.s?.[key] ?? NaN, (row) => (row.s?.count ? text(row.s[key]) : "–")];
  const plus = (x) => lengths.aligned(x, true);
  const columns = [["Face", (row) => -row.k, name, null]];
  if (measured) {
    columns.push(["Points", ...figure("count", count), "number rare"], [`Mean d${of}`, ...figure("signed_mean", plus), "number"], [`Std. dev.${of}`, ...figure("signed_std", lengths.aligned), "number rare"],
      [`95 % of |d|${of}`, ...figure("p95", lengths.aligned), "number"], [`Largest |d|${of}`, ...figure("max", lengths.aligned), "number"]);
    if (tolerance) columns.push(["Within", ...figure("within_tolerance", percent), "number"], ["Above", ...figure("above_tolerance", count), "number rare"], ["Below", ...figure("below_tolerance", count), "number rare"]);
  }
  columns.push(["Kind", (row) => surfaceKind(row.face), (row) => surfaceKind(row.face), "rare"], ["Degree", (row) => row.face.degree?.[0] ?? 0, (row) => row.face.degree?.join(" × ") ?? "–", "number rare"],
    ["Control points", (row) => (row.face.control_points ?? [0, 0]).reduce((a, b) => a * b), (row) => row.face.control_points?.join(" × ") ?? "–", "number rare"]);
  const made = sortable(rows, columns, measured ? columns.findIndex(([head]) => head.startsWith("Largest")) : 0);
  const note = measured ? element("p", { class: "quiet" }, "By the face of the nearest place of each point. The colour \u201Cmean deviation of faces\u201D shows them.") : "";
  return element("div", {}, long(made), note, element("p", { class: "quiet paper" }, faces.length > 12 ? `The first 12 of ${count(faces.length)} faces are printed.` : ""));
}

// The edges that are meant to be smooth, by the angle between the normals of their faces; `go(join)` when one is chosen.
function joinsTable(joins, lengths, go) {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  if (!smooth.length) return null;
  const angle = (x) => (Number.isFinite(x) ? exact(x, 2) : "–");
  const columns = [["Edge", (j) => -j.edge, (j) => element("button", { type: "button", class: "plain", onclick: () => go(j) }, `edge ${j.edge}`), null],
    ["Faces", (j) => j.faces.join(" "), (j) => j.faces.join(", "), null], ["At most, °", jumpOf, (j) => angle(j.bound), "number"], ["Sampled, °", (j) => j.sampled ?? NaN, (j) => angle(j.sampled), "number"],
    ["Length", (j) => j.length ?? NaN, (j) => lengths.alone(j.length ?? NaN), "number rare"]];
  const sharp = joins.filter((join) => join.kind === "sharp").length, open = joins.filter((join) => join.kind === "open").length;
  const words = `${count(smooth.length)} smooth edges${sharp ? `, ${count(sharp)} sharp` : ""}${open ? `, ${count(open)} at borders` : ""}. \u201CAt most\u201D holds on the whole edge, between the samples too.`;
  return element("div", {}, long(sortable(smooth, columns, 2)), element("p", { class: "quiet" }, words),
    element("p", { class: "quiet paper" }, smooth.length > 12 ? "The first 12 edges are printed." : ""));
}

// What the colours of edges mean, with how many there are of each.
function jumpSwatches(joins) {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  const found = JUMPS.map(([limit, colour], k) => {
    const n = smooth.filter((join) => jumpClass(join) === k).length, text = limit === Infinity ? `over ${JUMPS[k - 1][0]}°` : `to ${limit}°`;
    return [colour, `${text}: ${count(n)}`];
  });
  const sharp = joins.filter((join) => join.kind === "sharp").length;
  if (sharp) found.push(["feature", `sharp: ${count(sharp)}`]);
  const open = joins.filter((join) => join.kind === "open").length;
  if (open) found.push(["border", `border: ${count(open)}`]);
  return found;
}
