// Mouse, fingers and keys on an element, as motions of a camera.

import type { Camera } from "./camera";

/** What is told; places are in CSS pixels of the element. */
export interface Steered {
  /** After every motion of the camera. */
  changed(): void;
  /** It is pointed at a place, without a button. */
  hover(x: number, y: number): void;
  leave(): void;
  /** A double click. */
  focus(x: number, y: number): void;
  /** A key that does not move the camera; whether it was one of the view's. */
  key(key: string): boolean;
  /** A click; whether something took it. */
  tap(x: number, y: number): boolean;
}

/** A press that moves less than this, in CSS pixels, is a click. */
const STILL = 4;
/** Of the wheel: pixels per line, most pixels per event, pixels for a factor of e. */
const LINE = 30, MOST_WHEEL = 300, WHEEL = 500;
/** One press of a key: a shift in heights of the view, an angle in radians, a factor. */
const KEY_SHIFT = 1 / 20, KEY_TURN = 1 / 12, KEY_ZOOM = 0.85;

const ARROWS: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1],
};

/** Ends when the signal is aborted. */
export function steer(element: HTMLElement, camera: Camera, to: Steered, signal: AbortSignal): void {
  const down = new Map<number, readonly [number, number]>();
  let moved = 0;
  const at = (event: MouseEvent): [number, number] => {
    const box = element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const on = <K extends keyof HTMLElementEventMap>(
    name: K, what: (event: HTMLElementEventMap[K]) => void, passive = true,
  ): void => {
    element.addEventListener(name, what, { signal, passive });
  };
  on("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    down.set(event.pointerId, at(event));
    moved = 0;
    to.leave();
  });
  on("pointermove", (event) => {
    const now = at(event), before = down.get(event.pointerId);
    if (!before) {
      to.hover(...now);
      return;
    }
    const height = element.clientHeight, [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    moved += Math.hypot(dx, dy);
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const far = (p: readonly [number, number]): number => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      camera.pan(dx / 2 / height, -dy / 2 / height);
      camera.zoom(far(before) / far(now));
    } else if (event.shiftKey || event.buttons & 6) camera.pan(dx / height, -dy / height);
    else camera.orbit((Math.PI * dx) / height, (Math.PI * dy) / height);
    down.set(event.pointerId, now);
    to.changed();
  });
  const up = (event: PointerEvent): void => {
    if (!down.delete(event.pointerId) || moved >= STILL || event.type !== "pointerup") return;
    if (!(event.button === 0 && to.tap(...at(event)))) to.hover(...at(event));
  };
  on("pointerup", up);
  on("pointercancel", up);
  on("pointerleave", (event) => { if (event.pointerType !== "touch") to.leave(); });
  on("contextmenu", (event) => { event.preventDefault(); }, false);
  on("dblclick", (event) => { to.focus(...at(event)); });
  on("wheel", (event) => {
    event.preventDefault();
    const [x, y] = at(event), height = element.clientHeight;
    const turned = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE : 1);
    const step = Math.min(Math.max(turned, -MOST_WHEEL), MOST_WHEEL);
    camera.zoom(Math.exp(step / WHEEL), (x - element.clientWidth / 2) / height, (height / 2 - y) / height);
    to.changed();
  }, false);
  on("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { key, shiftKey } = event, arrow = ARROWS[key];
    if (arrow && shiftKey) camera.pan(arrow[0] * KEY_SHIFT, -arrow[1] * KEY_SHIFT);
    else if (arrow) camera.orbit(arrow[0] * KEY_TURN, arrow[1] * KEY_TURN);
    else if (key === "+" || key === "=") camera.zoom(KEY_ZOOM);
    else if (key === "-") camera.zoom(1 / KEY_ZOOM);
    else if (key === "[" || key === "]") camera.roll(key === "[" ? KEY_TURN : -KEY_TURN);
    else {
      if (to.key(key)) event.preventDefault();
      return;
    }
    event.preventDefault();
    to.changed();
  }, false);
}
