// The page's side of the worker: tasks as promises, progress, cancelling, and a new worker where the old one has ended.

import type { Answers, Ask, Failure, Reply, Task } from "./protocol";

/** Where a worker comes from; replaced in tests. */
export type Make = () => Pick<Worker, "postMessage" | "terminate" | "onmessage" | "onerror">;

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

/** A worker that is made again after it was ended; `reopen` then says which files it lacks. */
export class Engine {
  private worker: ReturnType<Make> | null = null;
  private open = new Map<number, Open>();
  private known = new Set<number>();
  private next = 1;

  /** `bytesOf` gives the content of a file again, for a new worker. */
  constructor(private readonly make: Make, private readonly bytesOf: (file: number) => Promise<{ name: string; bytes: ArrayBuffer }>) {}

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

  private start(): ReturnType<Make> {
    const worker = this.make();
    worker.onmessage = ({ data }: MessageEvent<Reply>) => { this.hear(data); };
    worker.onerror = (event) => {
      this.end({ kind: "crash", message: event.message || "the worker could not be started" });
    };
    return worker;
  }

  private hear(reply: Reply): void {
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

  /** Ends the worker; the next task makes a new one. */
  private end(failure: Failure): void {
    this.worker?.terminate();
    this.worker = null;
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
