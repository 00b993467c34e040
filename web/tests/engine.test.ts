import { describe, expect, test } from "vitest";
import { Engine, TaskError } from "../src/engine";
import type { Ask, Reply } from "../src/protocol";

/** A worker that is played by the test. */
class Played {
  static all: Played[] = [];
  asked: Ask[] = [];
  ended = false;
  onmessage: Worker["onmessage"] = null;
  onerror: Worker["onerror"] = null;
  constructor() { Played.all.push(this); }
  postMessage(ask: Ask): void { this.asked.push(ask); }
  terminate(): void { this.ended = true; }
  reply(reply: Reply): void { this.onmessage?.call(this as unknown as Worker, { data: reply } as MessageEvent<Reply>); }
}

function engine(): Engine {
  Played.all = [];
  return new Engine(() => new Played(), (file) => Promise.resolve({ name: `${file}.ply`, bytes: new ArrayBuffer(1) }));
}

const worker = (k: number): Played => {
  const found = Played.all[k];
  if (!found) throw new Error(`there is no worker ${k}`);
  return found;
};
const lastId = (of: Played): number => of.asked[of.asked.length - 1]?.id ?? -1;
const soon = (): Promise<void> => new Promise((done) => { setTimeout(done, 0); });

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
});
