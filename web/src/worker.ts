// The worker: the library in WebAssembly. It holds the files and the latest result, and does one task after another.

import { compare, fit, Input, simulate, type Comparison, type Fit, type Progress } from "nurbskin";
import { failure } from "./library";
import { load, type Loaded } from "./module";
import type { Answers, Ask, Begin, Cost, Reply, Task } from "./protocol";

let ready: Promise<Loaded> | null = null;
const files = new Map<number, Input>();
let result: Fit | Comparison | null = null;

/** Milliseconds between two messages of how far a stage has come. */
const PAUSE = 100;

function send(reply: Reply, moved: Transferable[] = []): void {
  self.postMessage(reply, { transfer: moved });
}

function progressOf(ask: Ask): Progress {
  const flag = ask.flag ? new Int32Array(ask.flag) : null;
  let steps = 0, sent = 0;
  return {
    stage(name, length) {
      steps = 0;
      send({ id: ask.id, stage: name, steps: length ?? null });
    },
    advance(more) {
      steps += more;
      if (performance.now() - sent < PAUSE) return;
      sent = performance.now();
      send({ id: ask.id, advance: steps });
    },
    tell(text) { send({ id: ask.id, tell: text }); },
    cancelled: () => flag !== null && Atomics.load(flag, 0) === 1,
  };
}

function open(file: number): Input {
  const input = files.get(file);
  if (!input) throw new Error("the file is not open in the worker");
  return input;
}

function keep(made: Fit | Comparison): void {
  result?.free();
  result = made;
}

/** Typed arrays of an object, which are moved, not copied. */
function arraysIn(value: unknown, found: Transferable[] = []): Transferable[] {
  if (value instanceof ArrayBuffer) found.push(value);
  else if (ArrayBuffer.isView(value)) found.push(value.buffer as ArrayBuffer);
  else if (Array.isArray(value)) return found;
  else if (typeof value === "object" && value !== null) for (const part of Object.values(value)) arraysIn(part, found);
  return found;
}

function buffer(bytes: Uint8Array): ArrayBuffer {
  const { buffer } = bytes;
  return buffer instanceof ArrayBuffer && bytes.byteLength === buffer.byteLength ? buffer : bytes.slice().buffer;
}

function openAs(file: number, name: string, bytes: Uint8Array): Input {
  files.get(file)?.free();
  files.delete(file);
  const input = new Input(name, bytes);
  files.set(file, input);
  return input;
}

function run(task: Task, progress: Progress, { threads, memory }: Loaded): Answers[keyof Answers] {
  const cost = (): Cost => ({ threads, bytes: memory.buffer.byteLength });
  switch (task.do) {
    case "look":
      return openAs(task.file, task.name, new Uint8Array(task.bytes)).look(progress);
    case "simulate": {
      const bytes = simulate(task.shape, task.options);
      const look = openAs(task.file, task.name, bytes).look(progress);
      return { look, bytes: buffer(bytes) };
    }
    case "fit": {
      const made = fit(open(task.file), task.options, progress);
      keep(made);
      return { figures: made.figures(), scene: made.scene(progress), cost: cost() };
    }
    case "compare": {
      const made = compare(open(task.file), open(task.cad), task.options, progress);
      keep(made);
      return { figures: made.figures(), scene: made.scene(progress), cost: cost() };
    }
    case "save":
      if (!result) throw new Error("there is no result to save");
      return buffer(result.save(task.name));
    case "identity":
      return open(task.file).identity();
    case "check":
      return open(task.file).check(progress);
    case "forget":
      files.get(task.file)?.free();
      files.delete(task.file);
      return null;
  }
}

self.onmessage = async ({ data }: MessageEvent<Begin | Ask>) => {
  if ("threads" in data) {
    ready = load(data, (pool) => { send({ pool }); });
    // Whoever waits for it hears of it.
    ready.catch(() => undefined);
    return;
  }
  try {
    if (!ready) throw new Error("the library has not been asked for");
    const answer = run(data, progressOf(data), await ready);
    send({ id: data.id, answer }, arraysIn(answer));
  } catch (error) {
    send({ id: data.id, failure: failure(error) });
  }
};
