// The page's side of the worker: tasks as promises, progress, cancelling, and a new worker where the old one has ended.

import type { Answers, Ask, Begin, Failure, Joining, Pool, Reply, Task } from "./protocol";

/** What is used of a worker. */
type Used = Pick<Worker, "postMessage" | "terminate" | "onmessage" | "onerror">;

/** Where workers come from; replaced in tests. */
export interface Make {
  /** The worker that does the tasks. */
  worker: () => Used;
  /** Another thread of the library. */
  thread: () => Used;
}

/** Called while a task goes on. */
export interface Listener {
  stage?: (name: string, steps: number | null) => void;
  advance?: (steps: number) => void;
  tell?: (text: string) => void;
}

/** A task that failed. */
export class TaskError extends Error {
  constructor(readonly failure: Failure) {
    super(failure.message);
  }
}

interface Open {
  done: (answer: never) => void;
  failed: (error: TaskError) => void;
  listener: Listener;
  flag: SharedArrayBuffer | null;
}

/** Milliseconds that a task has to notice the flag before its worker is ended. */
const PATIENCE = 800;

/**
 * Threads at most. A guard for computers with many cores: the threads share one lock for allocating memory, and each is a worker
 * of the browser with some megabytes of its own.
 */
const MOST_THREADS = 8;

/** Threads that can be asked for. A guard: rayon has no more than 255 where addresses have 32 bits. */
const MOST_ASKED = 64;

/**
 * How a worker loads the library on a computer with so many cores. In the address of the page, `?threads=N` asks for fewer or
 * more threads, and `?memory=BYTES` for less memory.
 */
export function beginOf(query: URLSearchParams, cores: number): Begin {
  const asked = (name: string): number | null => {
    const value = Math.floor(Number(query.get(name)));
    return value >= 1 && Number.isFinite(value) ? value : null;
  };
  return { threads: Math.min(asked("threads") ?? Math.min(cores, MOST_THREADS), MOST_ASKED), memory: asked("memory") };
}

/** A worker that is made again after it was ended, and the threads that join it. */
export class Engine {
  private worker: Used | null = null;
  private threads: Used[] = [];
  private open = new Map<number, Open>();
  private known = new Set<number>();
  private next = 1;

  /** `begin` says how a worker loads the library; `bytesOf` gives the content of a file again, for a new worker. */
  constructor(private readonly make: Make, private readonly begin: Begin, private readonly bytesOf: (file: number) => Promise<{ name: string; bytes: ArrayBuffer }>) {}

  /** Whether anything goes on. */
  get busy(): boolean { return this.open.size > 0; }

  /** Does a task; files that the worker does not have are opened first. */
  async run<D extends Task["do"]>(wanted: Extract<Task, { do: D }>, listener: Listener = {}): Promise<Answers[D]> {
    const task: Task = wanted;
    for (const file of needs(task)) {
      if (!this.known.has(file)) {
        const { name, bytes } = await this.bytesOf(file);
        await this.send({ do: "look", file, name, bytes }, listener);
        this.known.add(file);
      }
    }
    const answer = await this.send(task, listener);
    if (task.do === "look" || task.do === "simulate") this.known.add(task.file);
    if (task.do === "forget") this.known.delete(task.file);
    return answer as Answers[D];
  }

  /** Stops all tasks. Their promises fail with the kind `cancelled`. */
  cancel(): void {
    const open = [...this.open.values()];
    if (open.length === 0) return;
    const flags = open.map((task) => task.flag);
    if (flags.every((flag) => flag !== null)) {
      for (const flag of flags) Atomics.store(new Int32Array(flag), 0, 1);
      const ids = [...this.open.keys()];
      setTimeout(() => { if (ids.some((id) => this.open.has(id))) this.end({ kind: "cancelled", message: "cancelled" }); }, PATIENCE);
    } else {
      this.end({ kind: "cancelled", message: "cancelled" });
    }
  }

  private send(task: Task, listener: Listener): Promise<unknown> {
    const worker = this.worker ??= this.start();
    const id = this.next++;
    const flag = globalThis.crossOriginIsolated ? new SharedArrayBuffer(4) : null;
    const ask: Ask = { ...task, id, ...(flag ? { flag } : {}) };
    return new Promise((done, failed) => {
      this.open.set(id, { done, failed, listener, flag });
      worker.postMessage(ask, task.do === "look" ? [task.bytes] : []);
    });
  }

  private start(): Used {
    const worker = this.watched(this.make.worker());
    worker.onmessage = ({ data }: MessageEvent<Reply>) => { this.hear(data); };
    worker.postMessage(this.begin);
    return worker;
  }

  /** The worker cannot ask for them itself: while it computes, nothing that it has begun goes on. */
  private join({ module, memory, count }: Pool): void {
    for (let k = 0; k < count; k++) {
      const thread = this.watched(this.make.thread());
      thread.onmessage = ({ data }: MessageEvent<Failure>) => { this.end(data); };
      thread.postMessage({ module, memory } satisfies Joining);
      this.threads.push(thread);
    }
  }

  private watched(worker: Used): Used {
    worker.onerror = (event) => {
      this.end({ kind: "crash", message: event.message || "the worker could not be started" });
    };
    return worker;
  }

  private hear(reply: Reply): void {
    if ("pool" in reply) {
      this.join(reply.pool);
      return;
    }
    const task = this.open.get(reply.id);
    if (!task) return;
    if ("answer" in reply) {
      this.open.delete(reply.id);
      task.done(reply.answer as never);
    } else if ("failure" in reply) {
      this.open.delete(reply.id);
      task.failed(new TaskError(reply.failure));
      // The module cannot be used after a trap.
      if (reply.failure.kind === "memory" || reply.failure.kind === "crash") this.end(reply.failure);
    } else if ("stage" in reply) task.listener.stage?.(reply.stage, reply.steps);
    else if ("advance" in reply) task.listener.advance?.(reply.advance);
    else task.listener.tell?.(reply.tell);
  }

  /** Ends the worker and its threads; the next task makes new ones. */
  private end(failure: Failure): void {
    for (const ended of this.worker ? [this.worker, ...this.threads] : []) {
      // What is on its way from them is of no interest.
      ended.onmessage = ended.onerror = null;
      ended.terminate();
    }
    this.worker = null;
    this.threads = [];
    this.known.clear();
    const open = [...this.open.values()];
    this.open.clear();
    for (const task of open) task.failed(new TaskError(failure));
  }
}

/** The files that a task takes for granted. */
function needs(task: Task): number[] {
  switch (task.do) {
    case "fit": case "identity": case "check": return [task.file];
    case "compare": return [task.file, task.cad];
    default: return [];
  }
}
