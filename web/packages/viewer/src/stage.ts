// What is drawn: surface, lines and points as objects of the renderer, each with a material of its own.

import {
  BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, GLSL3, InstancedBufferGeometry, InstancedInterleavedBuffer,
  InterleavedBufferAttribute, LinearFilter, Mesh, Points, RawShaderMaterial, Scene, Vector2, Vector3, Vector4,
  type IUniform, type Texture, type WebGLRenderer,
} from "three";
import type { Camera } from "./camera";
import { BEYOND, JUMPS, MAPS, NO_DATA, REJECTED, TEXELS, jumpClass, mapBytes, parse, type MapName, type Scale } from "./colours";
import { boxOfPoints, segmentsOf, weighted, type Drawing, type Polylines, type Triangles } from "./drawing";
import { LINE_FRAGMENT, LINE_VERTEX, POINT_FRAGMENT, POINT_VERTEX, SURFACE_FRAGMENT, SURFACE_VERTEX } from "./shaders";
import { sub, type Vector } from "./vectors";

/** What can be shown or hidden. `unsupported` is the area without data, `rejected` the points that are not used. */
export type Layer = "surface" | "points" | "rejected" | "net" | "iso" | "edges" | "features" | "seams" | "unsupported" | "worst";

/** How it is drawn. */
export interface Settings {
  /** `plain`, `zebra`, `faces`, `jumps` (edges by the angle between their faces), or a name of the values. */
  mode: string;
  /** Of the values; null where the mode has none. */
  scale: Scale | null;
  layers: Record<Layer, boolean>;
  /** Hatches the area without data, where it is shown. */
  hatched: boolean;
  /** Of the zebra, over a half turn. */
  stripes: number;
  /** Octaves from the usual size of points. */
  pointSize: number;
  /** How far lines and points are lifted from the surface towards the eye, in the unit of the drawing. */
  lift: number;
  /** What is beyond this plane is not drawn. */
  cut: Plane | null;
  dark: boolean;
}

/** The places p with normal · p = offset. */
export interface Plane {
  normal: Vector;
  offset: number;
}

/** The size of a picture: CSS pixels, and how many of the canvas are in one. */
export interface Frame {
  width: number;
  height: number;
  pixel: number;
}

const INK = {
  light: {
    surface: "#b9c4d0", edges: "#15181c", features: "#7a1fa2", section: "#000000", seams: "#b0128c", iso_curves: "#4b5a6b",
    control_net: "#0a7d4b", points: "#22303f", mark: "#d6006c", foot: "#111111",
  },
  dark: {
    surface: "#aab6c4", edges: "#f2f5f8", features: "#e58cff", section: "#ffffff", seams: "#ff7ad9", iso_curves: "#22303f",
    control_net: "#35d08b", points: "#ffe9b0", mark: "#ff4fa3", foot: "#ffffff",
  },
};
type Ink = keyof typeof INK.light;

const rgb = (hex: string): Vector3 => new Vector3(...parse(hex));
const INKS = { light: inks(INK.light), dark: inks(INK.dark) };
function inks(of: Record<Ink, string>): Record<Ink, Vector3> {
  return Object.fromEntries(Object.entries(of).map(([name, hex]) => [name, rgb(hex)])) as Record<Ink, Vector3>;
}

/** Widths of lines and sizes of dots, in CSS pixels. */
const WIDTHS = { iso_curves: 1.1, edges: 2, features: 3.4, seams: 2.4, control_net: 1.2, jump: 4.5, section: 3, mark: 3 };
const DOTS = { control_net: 5, seams: 11, foot: 9, mark: 11 };
/** Sizes of points: the least of those with a shape; the least over a surface and alone; the most. */
const LEAST_SHAPE = 5, LEAST_ON = 3, LEAST_ALONE = 1.6, MOST = 9;
/** Depths about the target, in diagonals, between which points alone darken; beyond the far plane, where they do not. */
const FADE = [-0.3, 0.6] as const, NO_FADE = [1e30, 2e30] as const;

function shareInks(): Record<Ink, IUniform<Vector3>> {
  const made = Object.keys(INK.light).map((name) => [name, { value: new Vector3() }]);
  return Object.fromEntries(made) as Record<Ink, IUniform<Vector3>>;
}

/** Uniforms that all materials share. */
export interface Shared extends Record<string, IUniform> {
  cut: IUniform<Vector4>;
  screen: IUniform<Vector2>;
  pixel: IUniform<number>;
  perspective: IUniform<boolean>;
  map: IUniform<Texture | null>;
  low: IUniform<number>;
  high: IUniform<number>;
  band: IUniform<number>;
  below: IUniform<Vector3>;
  above: IUniform<Vector3>;
  none: IUniform<Vector3>;
  unsupported: IUniform<boolean>;
  rejects: IUniform<boolean>;
}

export function materialOf(vertexShader: string, fragmentShader: string, uniforms: Record<string, IUniform>): RawShaderMaterial {
  return new RawShaderMaterial({ glslVersion: GLSL3, vertexShader, fragmentShader, uniforms, side: DoubleSide });
}

type Shown = Mesh<BufferGeometry, RawShaderMaterial> | Points<BufferGeometry, RawShaderMaterial>;

/** An object that sets its own uniforms before each picture; `shown` says whether it is in it. */
interface Part {
  object: Shown;
  shown(settings: Settings): boolean;
  prepare(settings: Settings, ink: Record<Ink, Vector3>, camera: Camera, frame: Frame): void;
}

/** All objects of a drawing. */
export class Stage {
  readonly shared: Shared = {
    cut: { value: new Vector4() }, screen: { value: new Vector2() }, pixel: { value: 1 }, perspective: { value: true },
    map: { value: null }, low: { value: 0 }, high: { value: 1 }, band: { value: 0 },
    below: { value: new Vector3() }, above: { value: new Vector3() }, none: { value: rgb(NO_DATA) },
    unsupported: { value: true }, rejects: { value: true },
  };
  /** About the distance of neighbouring points. */
  private spacing = 1;
  private readonly scene = new Scene();
  private readonly maps: Record<MapName, DataTexture>;
  private readonly inks = shareInks();
  private parts: Part[] = [];
  /** The curve of a section, and the objects of a marked place. */
  private curve: Part | null = null;
  private marked: Part[] = [];
  /** The geometry of the points, which picking uses, too. */
  cloud: BufferGeometry | null = null;

  constructor(readonly drawing: Drawing) {
    this.maps = Object.fromEntries(MAPS.map((name) => [name, textureOf(name)])) as Record<MapName, DataTexture>;
    const { mesh, points, lines, poles } = drawing;
    if (mesh) this.parts.push(this.surface(mesh));
    for (const [layer, name] of [["iso", "iso_curves"]] as const) this.add(lines[name], layer, name);
    if (lines.edges) this.edges(lines.edges);
    this.add(lines.seams, "seams", "seams");
    this.add(lines.control_net, "net", "control_net");
    if (lines.control_net) this.parts.push(this.dots(lines.control_net.positions, "net", "control_net", DOTS.control_net, 1));
    if (poles.length) this.parts.push(this.dots(new Float32Array(poles.flat()), "seams", "seams", DOTS.seams, 2));
    if (points) this.parts.push(this.points(points));
    this.arrange();
  }

  /** The place that is marked: a point, its foot and the line between; null for none. */
  mark(point: Vector | null, foot: Vector | null): void {
    this.marked.forEach(({ object }) => { release(object); });
    this.marked = [];
    if (point && foot) {
      const line = this.line(new Float32Array([...point, ...foot]), "mark", WIDTHS.mark, 0, () => true);
      const ends = [this.dots(new Float32Array(foot), null, "foot", DOTS.foot, 0),
        this.dots(new Float32Array(point), null, "mark", DOTS.mark, 0)];
      this.marked = [line, ...ends];
      // Through the surface.
      for (const { object } of this.marked) object.material.depthTest = false;
    }
    this.arrange();
  }

  /** The curve of a section, as segments of six numbers; null for none. It lies in the plane that cuts, and is not cut. */
  section(segments: Float32Array | null): void {
    if (this.curve) release(this.curve.object);
    const uncut = { cut: { value: new Vector4() } };
    this.curve = segments?.length ? this.line(segments, "section", WIDTHS.section, 2, () => true, uncut) : null;
    this.arrange();
  }

  /** The size of points in CSS pixels: about their distance, seen from where the camera is. */
  pointSize(camera: Camera, settings: Settings, height: number): number {
    const on = !!this.drawing.mesh, close = this.spacing / camera.height * height * (on ? 0.6 : 1.2);
    return Math.min(Math.max(close, on ? LEAST_ON : LEAST_ALONE), MOST) * 2 ** settings.pointSize;
  }

  render(renderer: WebGLRenderer, camera: Camera, settings: Settings, frame: Frame): void {
    this.prepare(camera, settings, frame);
    const ink = INKS[settings.dark ? "dark" : "light"];
    for (const [name, colour] of Object.entries(ink)) this.inks[name as Ink].value = colour;
    for (const part of this.everything) {
      part.object.visible = part.shown(settings);
      if (part.object.visible) part.prepare(settings, ink, camera, frame);
    }
    renderer.setRenderTarget(null);
    renderer.render(this.scene, camera.forRenderer(frame.width / frame.height));
  }

  /** Sets what all materials share. */
  prepare(camera: Camera, { cut, scale, layers }: Settings, { width, height, pixel }: Frame): void {
    const { shared } = this, map = scale?.map ?? "diverging";
    if (cut) shared.cut.value.set(...cut.normal, cut.offset);
    else shared.cut.value.set(0, 0, 0, 0);
    shared.screen.value.set(width * pixel, height * pixel);
    shared.pixel.value = pixel;
    shared.perspective.value = camera.perspective;
    shared.map.value = this.maps[map];
    shared.low.value = scale?.low ?? 0;
    shared.high.value = scale?.high ?? 1;
    shared.band.value = scale?.band ?? 0;
    shared.below.value = rgb(BEYOND[map].below);
    shared.above.value = rgb(BEYOND[map].above);
    shared.unsupported.value = layers.unsupported;
    shared.rejects.value = layers.rejected;
  }

  dispose(): void {
    for (const { object } of this.everything) release(object);
    for (const map of Object.values(this.maps)) map.dispose();
  }

  private get everything(): Part[] { return [...this.parts, ...(this.curve ? [this.curve] : []), ...this.marked]; }

  /** Objects are drawn in the order in which they are here: the renderer does not sort them. */
  private arrange(): void {
    this.scene.clear();
    for (const { object } of this.everything) {
      object.frustumCulled = false;
      this.scene.add(object);
    }
  }

  private surface(mesh: Triangles): Part {
    const geometry = new BufferGeometry(), support = supportOf(mesh);
    geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
    if (mesh.normals) geometry.setAttribute("normal", new BufferAttribute(mesh.normals, 3));
    geometry.setAttribute("support", new BufferAttribute(support, 1, true));
    geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
    const values = new Values(geometry, mesh.values);
    const own = { mode: { value: 0 }, hatched: { value: false }, stripes: { value: 1 }, plain: this.inks.surface };
    return {
      object: new Mesh(geometry, materialOf(SURFACE_VERTEX, SURFACE_FRAGMENT, { ...this.shared, lift: { value: 0 }, ...own })),
      shown: ({ layers }) => layers.surface,
      prepare: ({ mode, hatched, stripes }) => {
        const valued = values.show(mode);
        own.mode.value = mode === "zebra" ? 2 : valued ? (mode === "faces" ? 3 : 1) : 0;
        own.hatched.value = hatched;
        own.stripes.value = stripes;
      },
    };
  }

  private points(points: NonNullable<Drawing["points"]>): Part {
    const geometry = this.cloud = new BufferGeometry(), count = points.positions.length / 3;
    geometry.setAttribute("position", new BufferAttribute(points.positions, 3));
    geometry.setAttribute("kind", new BufferAttribute(points.state, 1));
    const values = new Values(geometry, points.values);
    const { low, high } = boxOfPoints(points);
    // Were they spread over two sides of their box.
    const [a = 0, b = 0, c = 0] = sub(high, low).map((x) => (Number.isFinite(x) ? x : 0)).sort((p, q) => q - p);
    this.spacing = Math.sqrt((a * b + a * c + b * c || a * a || 1) / count);
    const own = {
      coloured: { value: false }, plain: this.inks.points, rejected: { value: rgb(REJECTED) }, dot_size: { value: 1 },
      least: { value: 1 }, fade: { value: new Vector2(...NO_FADE) }, lift: { value: 0 },
    };
    return {
      object: new Points(geometry, materialOf(POINT_VERTEX, POINT_FRAGMENT, { ...this.shared, ...own })),
      shown: ({ layers }) => layers.points,
      prepare: (settings, _, camera, { height, pixel }) => {
        own.coloured.value = values.show(settings.mode);
        own.dot_size.value = this.pointSize(camera, settings, height) * pixel;
        own.least.value = LEAST_SHAPE * pixel;
        own.lift.value = settings.lift;
        const { diagonal } = this.drawing.bounds;
        if (!this.drawing.mesh) own.fade.value.set(camera.distance + FADE[0] * diagonal, camera.distance + FADE[1] * diagonal);
      },
    };
  }

  /** Edges by how their faces join: sharp ones are feature lines, smooth ones are in classes of their angle, too. */
  private edges(edges: Polylines): void {
    const { joins } = this.drawing;
    const some = (wanted: (line: number) => boolean, ink: Ink, width: number, shown: Part["shown"], plain?: IUniform): void => {
      const all = segmentsOf(edges, wanted);
      if (all.length) this.parts.push(this.line(all, ink, width, 1, shown, plain ? { plain } : {}));
    };
    const classed = (line: number): number => {
      const join = joins[line];
      return join?.kind === "smooth" ? jumpClass(join) : -1;
    };
    const kind = (line: number): string | null | undefined => joins[line]?.kind;
    some((line) => kind(line) === "smooth", "edges", WIDTHS.edges, ({ mode, layers }) => layers.edges && mode !== "jumps");
    some((line) => kind(line) !== "smooth" && kind(line) !== "sharp", "edges", WIDTHS.edges, ({ layers }) => layers.edges);
    some((line) => kind(line) === "sharp", "features", WIDTHS.features, ({ layers }) => layers.features);
    JUMPS.forEach(([, colour], k) => {
      some((line) => classed(line) === k, "edges", WIDTHS.jump, ({ mode, layers }) => layers.edges && mode === "jumps",
        { value: rgb(colour) });
    });
  }

  private add(lines: Polylines | null | undefined, layer: Layer, ink: "iso_curves" | "seams" | "control_net"): void {
    if (lines) this.parts.push(this.line(segmentsOf(lines), ink, WIDTHS[ink], 1, ({ layers }) => layers[layer]));
  }

  private line(
    segments: Float32Array, ink: Ink, width: number, lifts: number, shown: Part["shown"], uniforms: Record<string, IUniform> = {},
  ): Part {
    const geometry = new InstancedBufferGeometry(), ends = new InstancedInterleavedBuffer(segments, 6);
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    geometry.setAttribute("from", new InterleavedBufferAttribute(ends, 3, 0));
    geometry.setAttribute("to", new InterleavedBufferAttribute(ends, 3, 3));
    geometry.instanceCount = segments.length / 6;
    const own = { width: { value: width }, lift: { value: 0 } };
    return {
      object: new Mesh(geometry, materialOf(LINE_VERTEX, LINE_FRAGMENT,
        { ...this.shared, plain: this.inks[ink], ...own, ...uniforms })),
      shown,
      prepare: ({ lift }, _ink, _camera, { pixel }) => {
        own.width.value = width * pixel;
        own.lift.value = lifts * lift;
      },
    };
  }

  private dots(positions: Float32Array, layer: Layer | null, ink: Ink, size: number, lifts: number): Part {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("kind", new BufferAttribute(new Uint8Array(positions.length / 3), 1));
    const own = {
      coloured: { value: false }, plain: this.inks[ink], rejected: { value: rgb(REJECTED) }, dot_size: { value: size },
      least: { value: size }, fade: { value: new Vector2(...NO_FADE) }, lift: { value: 0 },
    };
    return {
      object: new Points(geometry, materialOf(POINT_VERTEX, POINT_FRAGMENT, { ...this.shared, ...own })),
      shown: ({ layers }) => layer === null || layers[layer],
      prepare: ({ lift }, _ink, _camera, { pixel }) => {
        own.dot_size.value = size * pixel;
        own.lift.value = lifts * lift;
      },
    };
  }
}

/** Per vertex 255 where there is data, 0 where there is none. */
export function supportOf({ positions, values: { deviation } }: Triangles): Uint8Array<ArrayBuffer> {
  const support = new Uint8Array(positions.length / 3).fill(255);
  if (deviation) for (let i = 0; i < support.length; i++) if (!Number.isFinite(deviation[i])) support[i] = 0;
  return support;
}

/** The values of a geometry; those of one name at a time are its attribute, and each goes to the graphics card once. */
class Values {
  private readonly made = new Map<string, BufferAttribute>();
  constructor(private readonly geometry: BufferGeometry, private readonly lists: Readonly<Record<string, ArrayLike<number>>>) {}

  /** Whether there are any of this name. */
  show(name: string): boolean {
    const list = this.lists[name];
    if (!list) {
      this.geometry.deleteAttribute("value");
      return false;
    }
    let attribute = this.made.get(name);
    if (!attribute) {
      attribute = new BufferAttribute(weighted(list), 2);
      this.made.set(name, attribute);
    }
    this.geometry.setAttribute("value", attribute);
    return true;
  }
}

function textureOf(map: MapName): DataTexture {
  const texture = new DataTexture(mapBytes(map), TEXELS, 1);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function release({ geometry, material }: Shown): void {
  geometry.dispose();
  material.dispose();
}

/** Transparent, so that the background is that of the element. */
export function clear(renderer: WebGLRenderer): void {
  renderer.setClearColor(new Color(0, 0, 0), 0);
}
