// A camera that turns about a target, with perspective or without.

import { Matrix4, OrthographicCamera, PerspectiveCamera, Quaternion, Vector3, type Camera as RenderCamera } from "three";
import type { Bounds } from "./drawing";
import { X, Y, Z, add, cross, dot, size, sub, unit, type Vector } from "./vectors";

/** Where a camera is and what it looks at; `height` is that of the view, in the plane of the target. */
export interface Pose {
  rotation: Quaternion;
  target: Vector;
  height: number;
}

/** A line of sight. */
export interface Ray {
  from: Vector;
  direction: Vector;
}

const turned = (axis: Vector, angle: number): Quaternion => new Quaternion().setFromAxisAngle(new Vector3(...axis), angle);
const QUARTER = Math.PI / 2;
const front = turned(X, QUARTER);

export type ViewName = "iso" | "front" | "back" | "left" | "right" | "top" | "bottom";

/** Rotations by name; z is up. */
export const VIEWS: Record<ViewName, Quaternion> = {
  iso: turned(Z, Math.PI / 4).multiply(turned(X, Math.atan(Math.SQRT2))),
  front, back: turned(Z, Math.PI).multiply(front),
  left: turned(Z, -QUARTER).multiply(front), right: turned(Z, QUARTER).multiply(front),
  top: new Quaternion(), bottom: turned(X, Math.PI),
};

/** Half of the angle of view, in degrees: small, so that parts look as long as they are. */
const HALF_ANGLE = 14;
const TAN = Math.tan((HALF_ANGLE * Math.PI) / 180);
/** Limits of the height of the view, in diagonals of the drawing. */
const LEAST_HEIGHT = 1e-5, MOST_HEIGHT = 30;
/** The view is this much higher than what is in it: 7 % of room. */
const ROOM = 2.14;

/** The rotation of a camera that looks from `direction`, with `up` upwards. */
export function lookFrom(direction: Vector, up: Vector): Quaternion {
  const z = unit(direction);
  let x = cross(up, z);
  if (size(x) < 1e-3) x = cross(Y, z);
  if (size(x) < 1e-3) x = X;
  x = unit(x);
  const basis = new Matrix4().makeBasis(new Vector3(...x), new Vector3(...cross(z, x)), new Vector3(...z));
  return new Quaternion().setFromRotationMatrix(basis);
}

export class Camera {
  rotation = VIEWS.iso.clone();
  target: Vector;
  height: number;
  perspective = true;
  private readonly near = new PerspectiveCamera(2 * HALF_ANGLE);
  private readonly far = new OrthographicCamera();

  constructor(public bounds: Bounds) {
    this.target = bounds.centre;
    this.height = bounds.diagonal;
  }

  /** Directions to the right, upwards and towards the eye. */
  get axes(): [Vector, Vector, Vector] { return axesOf(this.rotation); }
  get distance(): number { return this.height / 2 / TAN; }
  get pose(): Pose { return { rotation: this.rotation.clone(), target: this.target, height: this.height }; }

  /** The pose that shows all from a direction, in the middle. */
  fitted(rotation: Quaternion, aspect: number): Pose {
    const axes = axesOf(rotation), { outline, centre, diagonal } = this.bounds;
    const seen = outline.map((p): Vector => [dot(axes[0], p), dot(axes[1], p), dot(axes[2], p)]);
    const middle = (k: 0 | 1): number => {
      let low = Infinity, high = -Infinity;
      for (const p of seen) [low, high] = [Math.min(low, p[k]), Math.max(high, p[k])];
      return low <= high ? (low + high) / 2 : 0;
    };
    const x = middle(0), y = middle(1);
    let need = 0;
    for (const p of seen) {
      need = Math.max(need, Math.max(Math.abs(p[1] - y), Math.abs(p[0] - x) / aspect) + (this.perspective ? TAN * p[2] : 0));
    }
    return { rotation: rotation.clone(), target: add(add(centre, axes[0], x), axes[1], y), height: ROOM * need || diagonal };
  }

  set(pose: Pose): void {
    const { diagonal } = this.bounds;
    this.rotation = pose.rotation.clone();
    this.target = pose.target;
    this.height = Math.min(Math.max(pose.height, LEAST_HEIGHT * diagonal), MOST_HEIGHT * diagonal);
  }

  /** By angles about the vertical and about the horizontal of the view. */
  orbit(dx: number, dy: number): void {
    const over = this.axes[1][2] < 0 ? -1 : 1; // upside down, the hand still leads
    this.rotation = turned(Z, -dx * over).multiply(this.rotation).multiply(turned(X, -dy)).normalize();
  }
  roll(angle: number): void { this.rotation.multiply(turned(Z, angle)).normalize(); }
  /** By shares of the height of the view. */
  pan(dx: number, dy: number): void {
    const [right, up] = this.axes;
    this.target = add(add(this.target, right, -dx * this.height), up, -dy * this.height);
  }
  /** About a place of the view, in heights from its middle. */
  zoom(factor: number, x = 0, y = 0): void {
    const before = this.height;
    this.set({ ...this.pose, height: before * factor });
    const [right, up] = this.axes, moved = before - this.height;
    this.target = add(add(this.target, right, x * moved), up, y * moved);
  }

  /** As the renderer takes it. */
  forRenderer(aspect: number): RenderCamera {
    const z = this.axes[2], d = this.distance, eye = add(this.target, z, d);
    const middle = dot(z, sub(eye, this.bounds.centre)), reach = 1.05 * this.bounds.reach;
    const camera = this.perspective ? this.near : this.far;
    camera.position.set(...eye);
    camera.quaternion.copy(this.rotation);
    camera.near = middle - reach;
    camera.far = middle + reach;
    if (this.perspective) {
      this.near.aspect = aspect;
      camera.far = Math.max(camera.far, d);
      // The depth of 24 bits tells apart a few thousandths at this ratio.
      camera.near = Math.max(camera.near, camera.far / 20000, Math.min(d / 50, camera.far / 2));
    } else {
      const half = this.height / 2;
      Object.assign(this.far, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    }
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return camera;
  }

  /** Where a place is seen: x and y in -1..=1 of the view, and how far in front of the eye. */
  project(place: Vector, aspect: number): { x: number; y: number; depth: number } {
    const v = sub(place, this.target), [right, up, back] = this.axes;
    const depth = this.distance - dot(back, v), half = this.perspective ? TAN * depth : this.height / 2;
    return { x: dot(right, v) / (half * aspect), y: dot(up, v) / half, depth };
  }

  /** The line of sight through x and y in -1..=1 of the view. */
  ray(x: number, y: number, aspect: number): Ray {
    const [right, up, back] = this.axes, half = this.height / 2;
    const through = add(add(this.target, right, x * half * aspect), up, y * half);
    const from = add(this.perspective ? this.target : through, back, this.distance);
    return { from, direction: unit(sub(through, from)) };
  }
}

function axesOf(rotation: Quaternion): [Vector, Vector, Vector] {
  const along = (axis: Vector): Vector => new Vector3(...axis).applyQuaternion(rotation).toArray();
  return [along(X), along(Y), along(Z)];
}
