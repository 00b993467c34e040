// A view: the picture, what lies over it, and the pointer. Nothing runs between pictures: one is drawn when something changes.

import { Quaternion, WebGLRenderer } from "three";
import { Camera, VIEWS, lookFrom, type Pose, type ViewName } from "./camera";
import type { Drawing } from "./drawing";
import { Overlay, type Handle, type Lengths, type Mark, type Pin } from "./overlay";
import { Picker, weightsOn, type OnTriangle } from "./picking";
import { Stage, clear, type Settings } from "./stage";
import { steer } from "./steering";
import { X, Z, add, at, cross, dot, mix, scaled, size, sub, unit, type Vector } from "./vectors";

/** What is at a place of the picture: a point, or a place on a triangle. Places are relative to the origin of the drawing. */
export type Found =
  | { kind: "point"; index: number; place: Vector }
  | { kind: "surface"; triangle: number; on: OnTriangle; place: Vector };

/** What the owner of a view is told; places are in CSS pixels of the canvas. */
export interface Told {
  /** It is pointed at a place, at most once per picture; null: what is there has changed, or it points nowhere. */
  hover?(place: [number, number] | null): void;
  /** A click; whether something took it. */
  tap?(x: number, y: number): boolean;
  /** A key, before the view's own; whether it was one. */
  key?(key: string): boolean;
  /** A numbered place has been chosen, or none (-1). */
  chosen?(k: number): void;
  /** A numbered place is clicked; without this they cannot be. */
  pin?(k: number): void;
  /** The handle of the section is dragged by a distance along its normal. */
  drag?(distance: number): void;
  /** The projection is changed. */
  projected?(perspective: boolean): void;
}

const KEYS: Record<string, ViewName | "fit"> = {
  f: "fit", F: "fit", Home: "fit", 0: "iso", 1: "front", 2: "back", 3: "left", 4: "right", 5: "top", 6: "bottom",
};
/** Milliseconds of a flight, and those without a change after which numbers behind the surface fade. */
const FLIGHT = 450, REST = 120;
/** Within this many CSS pixels of the pointer a point is found, and an edge. */
const NEAR_POINT = 5, NEAR_EDGE = 8;
/** The most pixels of the canvas in a CSS pixel: more are not seen. */
const FINEST = 2;

/** Settings of a view before anything is set. */
const FIRST: Settings = {
  mode: "plain", scale: null, hatched: true, stripes: 20, pointSize: 0, lift: 0, cut: null, dark: false,
  layers: {
    surface: true, points: true, rejected: true, net: false, iso: false, edges: true, features: true, seams: true,
    unsupported: true, worst: true,
  },
};

/** The elements of a view. */
export interface Elements {
  /** Holds both, and has a size of its own. */
  host: HTMLElement;
  canvas: HTMLCanvasElement;
  overlay: SVGSVGElement;
}

export class Viewer {
  readonly settings: Settings = structuredClone(FIRST);
  readonly camera: Camera;
  /** Pictures drawn so far. */
  frames = 0;
  private readonly renderer: WebGLRenderer;
  private readonly over: Overlay;
  private stage: Stage;
  private picker: Picker;
  private lengths: Lengths = { alone: String, round: (x) => x };
  private pins: readonly Pin[] = [];
  private chosen = -1;
  private marks: Mark[] = [];
  private handle: Handle | null = null;
  /** All is in view from here, whatever the size of the view, until something else is looked at. */
  private framed: Quaternion | null = VIEWS.iso;
  private flight: (() => void) | null = null;
  private drawing = 0;
  private hovering = 0;
  private settling: ReturnType<typeof setTimeout> | 0 = 0;
  private pointer: [number, number] | null = null;
  private lost = false;
  private readonly ended = new AbortController();
  private readonly watch: ResizeObserver;

  /** Throws an `Error` with the message "no WebGL 2" where there is none. */
  constructor(private readonly elements: Elements, drawing: Drawing, private readonly told: Told = {}) {
    const { canvas, overlay, host } = elements;
    // Kept after it is drawn, so that the canvas can be copied at any time.
    const context = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!context) throw new Error("no WebGL 2");
    this.renderer = new WebGLRenderer({ canvas, context, alpha: true });
    this.renderer.sortObjects = false;
    clear(this.renderer);
    this.over = new Overlay(overlay);
    this.stage = new Stage(drawing);
    this.picker = new Picker(this.stage);
    this.camera = new Camera(drawing.bounds);
    this.fit();
    this.listen();
    this.watch = new ResizeObserver(() => { this.resized(); });
    this.watch.observe(host);
  }

  get width(): number { return this.elements.canvas.clientWidth || 1; }
  get height(): number { return this.elements.canvas.clientHeight || 1; }
  get aspect(): number { return this.width / this.height; }
  /** Whether nothing is about to change. */
  get resting(): boolean { return !this.drawing && !this.settling && !this.flight; }

  /** Shows a drawing in place of the one before; all is in view, unless `keep`. */
  show(drawing: Drawing, keep = false): void {
    this.stage.dispose();
    this.picker.dispose();
    this.stage = new Stage(drawing);
    this.picker = new Picker(this.stage);
    this.camera.bounds = drawing.bounds;
    this.settings.cut = this.handle = null;
    this.setPins([]);
    this.marks = [];
    if (!keep) {
      this.framed = VIEWS.iso;
      this.fit();
    }
    this.changed();
  }

  /** Changes some of the settings. */
  set(some: Partial<Settings>): void {
    Object.assign(this.settings, some);
    this.changed();
  }

  /** How lengths are written. */
  setLengths(lengths: Lengths): void {
    this.lengths = lengths;
    this.changed();
  }

  /** The numbered places; those before are forgotten. */
  setPins(pins: readonly Pin[]): void {
    this.pins = pins;
    this.chosen = -1;
    this.stage.mark(null, null);
    this.over.setPins(pins, this.told.pin?.bind(this.told) ?? null);
    this.changed();
  }

  /** Distances and notes. */
  setMarks(marks: Mark[]): void {
    this.marks = marks;
    this.changed();
  }

  /** The section: its curve as segments of six numbers, and where its plane is held; what is cut away is a setting. */
  setSection(curve: Float32Array | null, handle: Handle | null): void {
    this.stage.section(curve);
    this.handle = handle;
    this.changed();
  }

  /** Has it drawn again: something has changed. */
  changed(): void {
    this.picker.stale = true;
    this.told.hover?.(null);
    if (!this.drawing) this.drawing = requestAnimationFrame(() => { this.drawing = 0; this.draw(); });
  }

  /** Looks from a side, at all. */
  look(name: ViewName | "fit"): void {
    this.framed = name === "fit" ? this.camera.rotation.clone() : VIEWS[name];
    void this.fly(this.camera.fitted(this.framed, this.aspect));
  }

  /** With perspective or without. */
  project(perspective: boolean): void {
    this.camera.perspective = perspective;
    this.framed = null;
    this.told.projected?.(perspective);
    this.changed();
  }

  /** Moves the camera to a pose; the promise is kept when it is there, or when another motion has begun. */
  fly(pose: Pose): Promise<void> {
    const from = this.camera.pose, still = matchMedia("(prefers-reduced-motion: reduce)").matches, begun = performance.now();
    return new Promise((done) => {
      const step = (): void => {
        if (this.flight !== step) {
          done();
          return;
        }
        const t = still ? 1 : Math.min(1, (performance.now() - begun) / FLIGHT), e = t * t * (3 - 2 * t);
        if (t === 1) this.flight = null;
        this.camera.set(t === 1 ? pose : {
          rotation: from.rotation.clone().slerp(pose.rotation, e), target: mix(from.target, pose.target, e),
          height: from.height * (pose.height / from.height) ** e,
        });
        this.changed();
        requestAnimationFrame(t === 1 ? () => { done(); } : step);
      };
      this.flight = step;
      step();
    });
  }

  /** Chooses a numbered place and goes there; -1 for none. */
  choose(k: number, go = true): Promise<void> | undefined {
    const pin = this.pins[k];
    this.chosen = pin ? k : -1;
    this.stage.mark(pin?.point ?? null, pin?.foot ?? null);
    this.told.chosen?.(this.chosen);
    this.changed();
    return pin && go ? this.approach(pin) : undefined;
  }

  /** Marks any place and goes there; a numbered one there is chosen. Returns its number, or -1. */
  visit(place: Vector): number {
    const near = 1e-6 * this.stage.drawing.bounds.diagonal;
    const known = this.pins.findIndex(({ point }) => size(sub(point, place)) < near);
    void this.choose(known);
    if (known < 0) {
      this.stage.mark(place, place);
      void this.approach({ point: place, foot: place, deviation: 0 });
    }
    return known;
  }

  /** What is at a place of the canvas in CSS pixels. */
  pick(x: number, y: number, radius = NEAR_POINT): Found | null {
    if (this.lost) return null;
    const { mesh, points } = this.stage.drawing;
    const found = this.picker.at(this.renderer, this.camera, this.settings, [this.width, this.height], x, y, radius);
    if (found && "point" in found) return points && { kind: "point", index: found.point, place: at(points.positions, found.point) };
    if (!found || !mesh) return null;
    const on = weightsOn(mesh, found.triangle, this.camera.ray(2 * x / this.width - 1, 1 - 2 * y / this.height, this.aspect));
    return { kind: "surface", triangle: found.triangle, on, place: on.place };
  }

  /** The number of the edge within a few pixels of a place of the canvas, and about as near as `near`, which is seen there. */
  edgeAt(x: number, y: number, near: Vector): number | null {
    const { lines: { edges }, bounds } = this.stage.drawing;
    let best = NEAR_EDGE, found: number | null = null, start = 0;
    for (let k = 0; edges && k < edges.lengths.length; k++) {
      const end = start + (edges.lengths[k] ?? 0);
      let before: [number, number] | null = null;
      for (let i = start; i < end; i++) {
        const place = at(edges.positions, i), pixel = this.locate(place);
        if (before && pixel && size(sub(place, near)) < 0.1 * bounds.size) {
          const [dx, dy] = [pixel[0] - before[0], pixel[1] - before[1]];
          const t = ((x - before[0]) * dx + (y - before[1]) * dy) / (dx * dx + dy * dy || 1);
          const s = Math.min(Math.max(t, 0), 1), far = Math.hypot(x - before[0] - s * dx, y - before[1] - s * dy);
          if (far < best) [best, found] = [far, k];
        }
        before = pixel;
      }
      start = end;
    }
    return found;
  }

  /** Where a place is seen, in CSS pixels of the canvas; null behind the eye. */
  locate(place: Vector): [number, number] | null {
    const { x, y, depth } = this.camera.project(place, this.aspect);
    return depth > 0 ? [(x + 1) / 2 * this.width, (1 - y) / 2 * this.height] : null;
  }

  /** A picture on a canvas of its own, `fine` times as fine as the screen, without what lies over it. */
  rendered(fine: number, some: Partial<Settings> = {}, width = this.width, height = this.height): HTMLCanvasElement {
    const copy = document.createElement("canvas");
    this.render({ ...this.settings, ...some }, width, height, fine);
    [copy.width, copy.height] = [this.elements.canvas.width, this.elements.canvas.height];
    copy.getContext("2d")?.drawImage(this.elements.canvas, 0, 0);
    this.draw();
    return copy;
  }

  /** A picture of this size, and from these sides, as addresses of PNGs without a background. */
  from(sides: readonly ViewName[], width: number, height: number): string[] {
    const before = this.camera.pose;
    const made = sides.map((name) => {
      this.camera.set(this.camera.fitted(VIEWS[name], width / height));
      return this.rendered(1, { dark: false }, width, height).toDataURL("image/png");
    });
    this.camera.set(before);
    this.changed();
    return made;
  }

  /** The picture as a PNG on a background. */
  picture(background: string): Promise<Blob | null> {
    const drawn = this.rendered(FINEST), pen = drawn.getContext("2d");
    if (pen) {
      pen.globalCompositeOperation = "destination-over";
      pen.fillStyle = background;
      pen.fillRect(0, 0, drawn.width, drawn.height);
    }
    return new Promise((done) => { drawn.toBlob(done, "image/png"); });
  }

  /** Draws now, and not at the next frame. */
  draw(): void {
    if (this.lost) return;
    this.render(this.settings, this.width, this.height, Math.min(devicePixelRatio || 1, FINEST));
    this.elements.overlay.dataset.theme = this.settings.dark ? "dark" : "light";
    this.drawOver();
    this.frames++;
    if (this.settling) clearTimeout(this.settling);
    this.settling = this.settings.layers.worst && this.pins.length && !this.flight ? setTimeout(() => { this.settle(); }, REST) : 0;
  }

  /** Frees what the graphics card holds, and listens no more. */
  dispose(): void {
    this.ended.abort();
    this.watch.disconnect();
    cancelAnimationFrame(this.drawing);
    if (this.settling) clearTimeout(this.settling);
    this.stage.dispose();
    this.picker.dispose();
    this.renderer.dispose();
  }

  private render(settings: Settings, width: number, height: number, pixel: number): void {
    this.renderer.setPixelRatio(pixel);
    this.renderer.setSize(width, height, false);
    this.stage.render(this.renderer, this.camera, settings, { width, height, pixel });
  }

  private drawOver(): void {
    const { cut, layers } = this.settings, { chosen, marks, handle, lengths, width, height } = this;
    const gone = (p: Vector): boolean => !!cut && dot(cut.normal, p) > cut.offset;
    this.over.draw(this.camera, { width, height, chosen, pinned: layers.worst, marks, handle, lengths, gone });
  }

  /** Numbers of places behind the surface fade once the view rests. */
  private settle(): void {
    this.settling = 0;
    const before = this.over.hidden.join();
    this.over.hidden = this.pins.map(({ point }) => {
      const place = this.locate(point), found = place && this.pick(...place, 0);
      return found?.kind === "surface" && this.depth(found.place) < this.depth(point) - this.settings.lift;
    });
    if (this.over.hidden.join() !== before) this.drawOver();
  }
  private depth(place: Vector): number { return this.camera.project(place, this.aspect).depth; }

  private listen(): void {
    const { canvas, overlay } = this.elements, { signal } = this.ended;
    steer(canvas, this.camera, {
      changed: () => { this.flight = this.framed = null; this.changed(); },
      hover: (x, y) => {
        this.pointer = [x, y];
        this.hovering ||= requestAnimationFrame(() => { this.hovering = 0; if (this.pointer) this.told.hover?.(this.pointer); });
      },
      leave: () => { this.pointer = null; this.told.hover?.(null); },
      focus: (x, y) => {
        const found = this.pick(x, y);
        if (!found) return;
        this.framed = null;
        void this.fly({ ...this.camera.pose, target: found.place });
      },
      key: (key) => this.key(key),
      tap: (x, y) => this.told.tap?.(x, y) ?? false,
    }, signal);
    // What the graphics card held is sent again by the renderer, as it is drawn.
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.lost = true; }, { signal });
    canvas.addEventListener("webglcontextrestored", () => { this.lost = false; this.changed(); }, { signal });
    this.dragging(overlay, signal);
  }

  /** The handle of the section's plane follows the pointer along the normal, or up and down where this points at the eye. */
  private dragging(overlay: SVGSVGElement, signal: AbortSignal): void {
    let last: [number, number] | null = null;
    overlay.addEventListener("pointerdown", (event) => {
      if (!(event.target as Element).closest(".handle")) return;
      event.preventDefault();
      overlay.setPointerCapture(event.pointerId);
      last = [event.clientX, event.clientY];
    }, { signal });
    overlay.addEventListener("pointermove", (event) => {
      if (!last || !this.handle) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]], { place, normal } = this.handle;
      const long = 0.01 * this.camera.height;
      const from = this.locate(place), to = this.locate(add(place, normal, long));
      const way: [number, number] = from && to ? [to[0] - from[0], to[1] - from[1]] : [0, 0], far = Math.hypot(...way);
      last = [event.clientX, event.clientY];
      this.told.drag?.(far < 1 ? -dy / this.height * this.camera.height : long * (dx * way[0] + dy * way[1]) / far ** 2);
    }, { signal });
    for (const name of ["pointerup", "pointercancel"] as const) overlay.addEventListener(name, () => { last = null; }, { signal });
  }

  private key(key: string): boolean {
    if (this.told.key?.(key)) return true;
    const view = KEYS[key];
    if (view) this.look(view);
    else if (key === "p" || key === "P") this.project(!this.camera.perspective);
    else if (key === "Escape" && this.chosen >= 0) void this.choose(-1);
    else return false;
    return true;
  }

  /** The page gets its final layout only after the first frame, and windows change. */
  private resized(): void {
    if (this.framed) {
      this.flight = null;
      this.fit();
    }
    this.changed();
  }

  private fit(): void {
    if (this.framed) this.camera.set(this.camera.fitted(this.framed, this.aspect));
  }

  private approach({ point, foot, deviation }: Pick<Pin, "point" | "foot" | "deviation">): Promise<void> {
    this.framed = null;
    this.elements.host.scrollIntoView({ block: "nearest" });
    const normal = this.normalAt(point, foot, deviation), { size: large } = this.stage.drawing.bounds;
    // Aslant, so that the line between point and foot is seen from the side.
    let over = sub(Z, scaled(normal, normal[2]));
    if (size(over) < 0.2) over = sub(X, scaled(normal, normal[0]));
    const across = unit(cross(normal, unit(over))), from = add(add(scaled(normal, 0.72), unit(over), -0.35), across, 0.6);
    // Some times the deviation, but neither so near that nothing else is seen, nor so far that the place is not.
    const near = Math.min(Math.max(18 * Math.abs(deviation || 0), 0.03 * large), 0.6 * large);
    // However far apart, both ends of the line are seen.
    const height = Math.max(near, 2.4 * size(sub(point, foot)) / Math.min(1, this.aspect));
    return this.fly({ rotation: lookFrom(from, Z), target: mix(point, foot, 0.5), height });
  }

  /** The normal of the surface at a foot; without a surface, the way from there to the point. */
  private normalAt(point: Vector, foot: Vector, deviation: number): Vector {
    const { mesh } = this.stage.drawing, away = sub(point, foot);
    if (mesh?.normals) {
      const p = mesh.positions;
      let best = Infinity, found = 0;
      for (let i = 0; i < p.length; i += 3) {
        const d = ((p[i] ?? 0) - foot[0]) ** 2 + ((p[i + 1] ?? 0) - foot[1]) ** 2 + ((p[i + 2] ?? 0) - foot[2]) ** 2;
        if (d < best) [best, found] = [d, i / 3];
      }
      return unit(at(mesh.normals, found));
    }
    return size(away) > 0 ? scaled(unit(away), Math.sign(deviation || 1)) : this.camera.axes[2];
  }
}
