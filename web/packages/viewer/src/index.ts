// Draws a scene of nurbskin: points, faces with colours, lines, marked places. It draws only when something has changed.

import {
  BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, Group, HemisphereLight, LineBasicMaterial, LineSegments,
  Mesh, MeshStandardMaterial, PerspectiveCamera, Points, PointsMaterial, Scene as Stage, ShaderMaterial, Spherical, Vector3,
  WebGLRenderer, type Material, type Object3D,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { around, coloursOf, spread, type Scale } from "./colours";
import { distanceFor, pieces, type Polylines } from "./geometry";

export * from "./colours";
export * from "./geometry";

type Point = [number, number, number];

/** What is drawn; the `Scene` of the package nurbskin is one. */
export interface Drawing {
  bounding_box: [Point, Point];
  origin: Point;
  mesh: {
    positions: Float32Array; normals: Float32Array; triangles: Uint32Array;
    deviation: Float32Array | null; mean_curvature: Float32Array | null; gaussian_curvature: Float32Array | null;
  } | null;
  lines: { edges?: Polylines; seams?: Polylines; iso_curves?: Polylines; control_net?: Polylines };
  points: { positions: Float32Array; deviation: Float32Array | null; state: Uint8Array } | null;
}

/** How faces, or points where there are no faces, are coloured. */
export type Mode = "plain" | "deviation" | "mean_curvature" | "gaussian_curvature" | "zebra";
/** What can be shown or hidden. */
export type Layer = "surface" | "points" | "edges" | "iso_curves" | "control_net";

/** A marked place, in the coordinates of the file. */
export interface Marker {
  point: Point;
  text: string;
  /** What it is, for screen readers and as a tip. */
  label: string;
  kind: "worst" | "finding";
}

const ANGLE = 40;
/** Stripes of the zebra over a half turn. */
const STRIPES = 24;

/** Colours of a theme. */
const THEMES = {
  light: { back: "#f3f5f7", plain: "#9fb4c7", point: "#31506e", edge: "#1b2733", iso: "#47627c", net: "#a33c6d" },
  dark: { back: "#14181d", plain: "#7d93a8", point: "#b9d2ea", edge: "#e7edf3", iso: "#a8bdd1", net: "#ff9ac4" },
};

/** A view in an element; the element should have a size of its own. */
export class Viewer {
  readonly canvas: HTMLCanvasElement;
  private readonly renderer: WebGLRenderer;
  private readonly stage = new Stage();
  private readonly camera = new PerspectiveCamera(ANGLE, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly light = new DirectionalLight(0xffffff, 2.2);
  private readonly marks: HTMLElement;
  private readonly watch: ResizeObserver;
  private groups = new Map<Layer, Group>();
  private hidden = new Set<Layer>();
  private markers: { at: Vector3; button: HTMLButtonElement }[] = [];
  private drawing: Drawing | null = null;
  private radius = 1;
  private mode: Mode = "plain";
  private scale: Scale = around(1);
  private theme = THEMES.light;
  private waiting = false;
  /** Number of frames drawn. */
  frames = 0;

  /** Throws if there is no WebGL. */
  constructor(private readonly host: HTMLElement, label: string) {
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", label);
    this.marks = document.createElement("div");
    this.marks.className = "marks";
    host.append(this.canvas, this.marks);
    this.camera.up.set(0, 0, 1);
    this.stage.add(new HemisphereLight(0xffffff, 0x667788, 1.4), this.camera);
    this.camera.add(this.light);
    this.light.position.set(0.4, 0.7, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => { this.draw(); });
    this.canvas.addEventListener("keydown", (event) => { this.onKey(event); });
    this.watch = new ResizeObserver(() => { this.resize(); });
    this.watch.observe(host);
    this.resize();
  }

  /** Shows a drawing in place of the one before. The view is kept where the place is nearly the same. */
  show(drawing: Drawing): void {
    const before = this.drawing;
    this.clear();
    this.drawing = drawing;
    const [low, high] = drawing.bounding_box;
    this.radius = Math.max(0.5 * Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]), 1e-12);
    const { mesh, points, lines } = drawing;
    if (mesh) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
      geometry.setAttribute("normal", new BufferAttribute(mesh.normals, 3));
      geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
      this.add("surface", new Mesh(geometry));
    }
    if (points) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(points.positions, 3));
      this.add("points", new Points(geometry));
    }
    for (const [layer, of] of [["edges", [lines.edges, lines.seams]], ["iso_curves", [lines.iso_curves]], ["control_net", [lines.control_net]]] as const) {
      for (const polylines of of) {
        if (!polylines) continue;
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(polylines.positions, 3));
        geometry.setIndex(new BufferAttribute(pieces(polylines), 1));
        this.add(layer, new LineSegments(geometry));
      }
    }
    this.paint();
    const same = before && Math.hypot(...before.origin.map((x, k) => x - (drawing.origin[k] ?? 0))) < 0.2 * this.radius;
    if (!same) this.fit();
    this.draw();
  }

  /** The colours of faces and points, on a scale where they are of a value. */
  colour(mode: Mode, scale?: Scale): void {
    this.mode = mode;
    const values = mode === "plain" || mode === "zebra" ? null : this.drawing?.mesh?.[mode] ?? this.drawing?.points?.deviation;
    this.scale = scale ?? (values ? spread(values) : around(1));
    this.paint();
  }

  /** The scale of the colours now. */
  get scaleNow(): Scale { return this.scale; }

  /** Shows or hides a layer. */
  layer(layer: Layer, shown: boolean): void {
    if (shown) this.hidden.delete(layer); else this.hidden.add(layer);
    const group = this.groups.get(layer);
    if (group) group.visible = shown;
    this.draw();
  }

  /** The layers that the drawing has. */
  get layers(): Layer[] { return [...this.groups.keys()]; }

  /** Light or dark. */
  setTheme(name: keyof typeof THEMES): void {
    this.theme = THEMES[name];
    this.paint();
  }

  /** Marks places with buttons; `chosen` is called for the one that is clicked. */
  mark(markers: Marker[], chosen: (k: number) => void): void {
    this.marks.replaceChildren();
    const origin = new Vector3(...(this.drawing?.origin ?? [0, 0, 0]));
    this.markers = markers.map((marker, k) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = `mark ${marker.kind}`;
      button.textContent = marker.text;
      button.title = marker.label;
      button.setAttribute("aria-label", marker.label);
      button.addEventListener("click", () => { chosen(k); });
      this.marks.append(button);
      return { at: new Vector3(...marker.point).sub(origin), button };
    });
    this.draw();
  }

  /** Turns and moves the view to a marked place, from outside. */
  visit(k: number): void {
    const marker = this.markers[k];
    if (!marker) return;
    const away = marker.at.clone().sub(this.controls.target);
    if (away.lengthSq() < 1e-12 * this.radius * this.radius) away.copy(this.camera.position).sub(this.controls.target);
    const outside = marker.at.lengthSq() > 1e-12 * this.radius * this.radius ? marker.at.clone().normalize() : away.normalize();
    this.controls.target.copy(marker.at);
    this.camera.position.copy(marker.at).addScaledVector(outside, 1.1 * this.radius);
    for (const other of this.markers) other.button.classList.toggle("chosen", other === marker);
    this.controls.update();
    this.draw();
  }

  /** All in view, from the front right and above. */
  fit(): void {
    const distance = 1.05 * distanceFor(this.radius, ANGLE, this.camera.aspect);
    this.camera.near = this.radius / 200;
    this.camera.far = this.radius * 40;
    this.camera.updateProjectionMatrix();
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0.62, -0.62, 0.48).normalize().multiplyScalar(distance);
    this.controls.minDistance = this.radius / 50;
    this.controls.maxDistance = this.radius * 20;
    this.controls.update();
    this.draw();
  }

  /** The picture as a PNG. */
  picture(): Promise<Blob | null> {
    this.render();
    return new Promise((done) => { this.canvas.toBlob(done, "image/png"); });
  }

  /** Frees what the graphics card holds. */
  dispose(): void {
    this.clear();
    this.watch.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.host.replaceChildren();
  }

  private add(layer: Layer, object: Mesh | Points | LineSegments): void {
    let group = this.groups.get(layer);
    if (!group) {
      group = new Group();
      group.visible = !this.hidden.has(layer);
      this.groups.set(layer, group);
      this.stage.add(group);
    }
    object.frustumCulled = false;
    group.add(object);
  }

  private clear(): void {
    for (const group of this.groups.values()) {
      for (const child of group.children) release(child);
      this.stage.remove(group);
    }
    this.groups.clear();
    this.marks.replaceChildren();
    this.markers = [];
    this.drawing = null;
  }

  /** New materials for mode and theme. */
  private paint(): void {
    this.stage.background = new Color(this.theme.back);
    const { drawing, mode } = this;
    const valued = mode !== "plain" && mode !== "zebra";
    for (const [layer, group] of this.groups) {
      for (const child of group.children as (Mesh | Points | LineSegments)[]) {
        let material: Material;
        if (layer === "surface" || layer === "points") {
          const values = !valued || !drawing ? null
            : layer === "surface" ? drawing.mesh?.[mode] ?? null
            : mode === "deviation" ? drawing.points?.deviation ?? null : null;
          if (values) child.geometry.setAttribute("color", new BufferAttribute(coloursOf(values, this.scale), 3, true));
          else child.geometry.deleteAttribute("color");
          material = layer === "surface" ? this.ofSurface(!!values) : this.ofPoints(!!values);
        } else {
          const colour = layer === "edges" ? this.theme.edge : layer === "iso_curves" ? this.theme.iso : this.theme.net;
          material = new LineBasicMaterial({ color: colour, transparent: layer !== "edges", opacity: layer === "edges" ? 1 : 0.7 });
        }
        (child.material as Material).dispose();
        child.material = material;
      }
    }
    this.draw();
  }

  private ofSurface(coloured: boolean): Material {
    // Lines and points lie on the faces, which stand back a little for them.
    const back = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 2, side: DoubleSide };
    if (this.mode === "zebra") {
      return new ShaderMaterial({
        ...back,
        vertexShader: `
          varying vec3 vNormal, vPlace;
          void main() {
            vNormal = normalMatrix * normal;
            vec4 place = modelViewMatrix * vec4(position, 1.0);
            vPlace = place.xyz;
            gl_Position = projectionMatrix * place;
          }`,
        // Stripes of a room of striped walls in a mirror: even where the surface is smooth to the second order.
        fragmentShader: `
          varying vec3 vNormal, vPlace;
          void main() {
            vec3 n = normalize(vNormal);
            if (!gl_FrontFacing) n = -n;
            vec3 r = reflect(normalize(vPlace), n);
            float wave = sin(${STRIPES.toFixed(1)} * acos(clamp(r.y, -1.0, 1.0)));
            float width = fwidth(wave);
            float stripe = smoothstep(-width, width, wave);
            gl_FragColor = vec4(mix(vec3(0.08), vec3(0.96), stripe) * (0.75 + 0.25 * n.z), 1.0);
          }`,
      });
    }
    return new MeshStandardMaterial({
      ...back, roughness: 0.65, metalness: 0.05, vertexColors: coloured, color: coloured ? "#ffffff" : this.theme.plain,
    });
  }

  private ofPoints(coloured: boolean): Material {
    const few = (this.drawing?.points?.state.length ?? 0) < 20_000;
    return new PointsMaterial({
      size: (few ? 2.5 : 1.5) * this.renderer.getPixelRatio(), sizeAttenuation: false,
      vertexColors: coloured, color: coloured ? "#ffffff" : this.theme.point,
    });
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const turn = Math.PI / 24;
    const moves: Record<string, [number, number, number]> = {
      ArrowLeft: [-turn, 0, 1], ArrowRight: [turn, 0, 1], ArrowUp: [0, -turn, 1], ArrowDown: [0, turn, 1],
      "+": [0, 0, 1 / 1.15], "=": [0, 0, 1 / 1.15], "-": [0, 0, 1.15],
    };
    const move = moves[event.key];
    if (event.key === "f" || event.key === "Home") this.fit();
    else if (move) this.turn(...move);
    else return;
    event.preventDefault();
  }

  private turn(around: number, over: number, zoom: number): void {
    // Angles about the vertical axis, which is z here and y in a `Spherical`.
    const offset = this.camera.position.clone().sub(this.controls.target);
    const at = new Spherical().setFromVector3(new Vector3(offset.x, offset.z, -offset.y));
    at.theta += around;
    at.phi = Math.min(Math.max(at.phi + over, 0.01), Math.PI - 0.01);
    at.radius = Math.min(Math.max(at.radius * zoom, this.controls.minDistance), this.controls.maxDistance);
    const moved = new Vector3().setFromSpherical(at);
    this.camera.position.set(moved.x, -moved.z, moved.y).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private draw(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.render();
    });
  }

  private render(): void {
    this.renderer.render(this.stage, this.camera);
    this.frames += 1;
    const { clientWidth: width, clientHeight: height } = this.host;
    for (const { at, button } of this.markers) {
      const seen = at.clone().project(this.camera);
      const inside = Math.abs(seen.x) < 1 && Math.abs(seen.y) < 1 && seen.z < 1;
      button.hidden = !inside;
      button.style.transform = `translate(${(0.5 * (seen.x + 1) * width).toFixed(1)}px, ${(0.5 * (1 - seen.y) * height).toFixed(1)}px) translate(-50%, -50%)`;
    }
  }
}

function release(object: Object3D): void {
  if (object instanceof Mesh || object instanceof Points || object instanceof LineSegments) {
    (object.geometry as BufferGeometry).dispose();
    (object.material as Material).dispose();
  }
}
