import { describe, expect, test } from "vitest";
import { beginOf, Engine, TaskError } from "../src/engine";
import type { Ask, Begin, Failure, Joining, Reply } from "../src/protocol";

/** A worker that is played by the test. */
class Played {
  static all: Played[] = [];
  static threads: Played[] = [];
  begun: Begin | Joining | null = null;
  asked: Ask[] = [];
  ended = false;
  onmessage: Worker["onmessage"] = null;
  onerror: Worker["onerror"] = null;
  constructor(list: Played[]) { list.push(this); }
  postMessage(said: Ask | Begin | Joining): void {
    if ("do" in said) this.asked.push(said);
    else this.begun = said;
  }
  terminate(): void { this.ended = true; }
  reply(reply: Reply | Failure): void { this.onmessage?.call(this as unknown as Worker, { data: reply } as MessageEvent<Reply | Failure>); }
}

function engine(): Engine {
  Played.all = [];
  Played.threads = [];
  const make = { worker: () => new Played(Played.all), thread: () => new Played(Played.threads) };
  return new Engine(make, { threads: 3, memory: null }, (file) => Promise.resolve({ name: `${file}.ply`, bytes: new ArrayBuffer(1) }));
}

const worker = (k: number): Played => {
  const found = Played.all[k];
  if (!found) throw new Error(`there is no worker ${k}`);
  return found;
};
const lastId = (of: Played): number => of.asked[of.asked.length - 1]?.id ?? -1;
const soon = (): Promise<void> => new Promise((done) => { setTimeout(done, 0); });

test("threads and memory are those of the computer, or of the address", () => {
  const begin = (query: string, cores: number): Begin => beginOf(new URLSearchParams(query), cores);
  expect(begin("", 4)).toEqual({ threads: 4, memory: null });
  expect(begin("", 64)).toEqual({ threads: 8, memory: null });
  expect(begin("threads=1&memory=1e8", 4)).toEqual({ threads: 1, memory: 1e8 });
  expect(begin("threads=12", 4).threads).toBe(12);
  expect(begin("threads=1e9", 4).threads).toBe(64);
  expect(begin("threads=none&memory=-1", 2)).toEqual({ threads: 2, memory: null });
});

describe("the engine", () => {
  test("opens the file of a task first, once", async () => {
    const it = engine();
    const first = it.run<"fit">({ do: "fit", file: 7, options: {} });
    await soon();
    expect(worker(0).asked.map((ask) => ask.do)).toEqual(["look"]);
    worker(0).reply({ id: lastId(worker(0)), answer: null });
    await soon();
    expect(worker(0).asked.map((ask) => ask.do)).toEqual(["look", "fit"]);
    worker(0).reply({ id: lastId(worker(0)), answer: null });
    await first;
    expect(it.busy).toBe(false);
    const second = it.run<"fit">({ do: "fit", file: 7, options: {} });
    await soon();
    expect(worker(0).asked.map((ask) => ask.do)).toEqual(["look", "fit", "fit"]);
    worker(0).reply({ id: lastId(worker(0)), answer: null });
    await second;
  });

  test("tells how far a task has come", async () => {
    const it = engine(), heard: unknown[] = [];
    const task = it.run<"save">({ do: "save", name: "a.step" }, { stage: (name, steps) => heard.push(name, steps), advance: (n) => heard.push(n), tell: (text) => heard.push(text) });
    await soon();
    const id = lastId(worker(0));
    worker(0).reply({ id, stage: "fit", steps: 10 });
    worker(0).reply({ id, advance: 4 });
    worker(0).reply({ id, tell: "40 faces" });
    worker(0).reply({ id: id + 99, tell: "of another" });
    worker(0).reply({ id, answer: new ArrayBuffer(2) });
    expect((await task).byteLength).toBe(2);
    expect(heard).toEqual(["fit", 10, 4, "40 faces"]);
  });

  test("ends the worker to cancel, and makes a new one that opens the file again", async () => {
    const it = engine();
    const task = it.run<"look">({ do: "look", file: 1, name: "a", bytes: new ArrayBuffer(1) });
    await soon();
    worker(0).reply({ id: lastId(worker(0)), answer: null });
    await task;
    const fit = it.run<"fit">({ do: "fit", file: 1, options: {} });
    await soon();
    it.cancel();
    await expect(fit).rejects.toMatchObject({ failure: { kind: "cancelled" } });
    expect(worker(0).ended).toBe(true);
    const again = it.run<"fit">({ do: "fit", file: 1, options: {} });
    await soon();
    expect(worker(1).asked.map((ask) => ask.do)).toEqual(["look"]);
    it.cancel();
    await expect(again).rejects.toBeInstanceOf(TaskError);
  });

  test("leaves a worker that has run out of memory, but not one that refused a file", async () => {
    const it = engine();
    const refused = it.run<"look">({ do: "look", file: 1, name: "a", bytes: new ArrayBuffer(1) });
    await soon();
    worker(0).reply({ id: lastId(worker(0)), failure: { kind: "read", message: "not a scan" } });
    await expect(refused).rejects.toThrow("not a scan");
    expect(worker(0).ended).toBe(false);
    const full = it.run<"look">({ do: "look", file: 1, name: "a", bytes: new ArrayBuffer(1) });
    await soon();
    worker(0).reply({ id: lastId(worker(0)), failure: { kind: "memory", message: "" } });
    await expect(full).rejects.toMatchObject({ failure: { kind: "memory" } });
    expect(worker(0).ended).toBe(true);
  });

  test("brings the threads that the worker asks for, and ends them with it when one has failed", async () => {
    const it = engine();
    const fit = it.run<"save">({ do: "save", name: "a.step" });
    await soon();
    expect(worker(0).begun).toEqual({ threads: 3, memory: null });
    const memory = new WebAssembly.Memory({ initial: 1 }), module = new WebAssembly.Module(new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0]));
    worker(0).reply({ pool: { module, memory, count: 2 } });
    expect(Played.threads.map(({ begun }) => begun)).toEqual([{ module, memory }, { module, memory }]);
    Played.threads[1]?.reply({ kind: "memory", message: "full" });
    await expect(fit).rejects.toMatchObject({ failure: { kind: "memory" } });
    expect([worker(0), ...Played.threads].map(({ ended }) => ended)).toEqual([true, true, true]);
    // What they say after that is not heard.
    const next = it.run<"save">({ do: "save", name: "a.step" });
    await soon();
    Played.threads[0]?.reply({ kind: "memory", message: "full" });
    expect(worker(1).ended).toBe(false);
    worker(1).reply({ id: lastId(worker(1)), answer: null });
    await next;
  });
});
