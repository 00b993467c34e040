// Loads the library in the worker: on several threads where the page may share memory and the module is built for that.

import { startThreads } from "nurbskin";
import address from "nurbskin/nurbskin_bg.wasm?url";
import { start } from "./library";
import { importedMemory, PAGE, unshare } from "./memory";
import type { Begin, Pool } from "./protocol";

/** The library, loaded. */
export interface Loaded {
  threads: number;
  /** It only grows: its size is the most that was needed. */
  memory: WebAssembly.Memory;
}

/** Loads it; `ask` makes the workers that are the other threads. */
export async function load({ threads, memory: most }: Begin, ask: (pool: Pool) => void): Promise<Loaded> {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`the library cannot be loaded: ${answer.status}`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  const limits = importedMemory(bytes);
  if (!limits) {
    const { memory } = await start({ module_or_path: bytes });
    return { threads: 1, memory };
  }
  const initial = limits.minimum, maximum = Math.max(initial, Math.min(limits.maximum, Math.floor((most ?? Infinity) / PAGE)));
  let memory: WebAssembly.Memory | null = null;
  if (threads > 1 && self.crossOriginIsolated) {
    try {
      memory = new WebAssembly.Memory({ initial, maximum, shared: true });
    } catch {
      // Shared memory takes all its addresses at once, of which a browser of 32 bits has too few.
    }
  }
  const alone = memory === null;
  if (alone) unshare(bytes, limits);
  memory ??= new WebAssembly.Memory({ initial, maximum });
  const module = await WebAssembly.compile(bytes);
  await start({ module_or_path: module, memory });
  if (alone) return { threads: 1, memory };
  ask({ module, memory, count: threads - 1 });
  // Waits until the others are there.
  startThreads(threads);
  return { threads, memory };
}
