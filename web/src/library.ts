// The start of the library's module, and its end.

import init, { lastPanic, type InitInput, type InitOutput } from "nurbskin";
import type { Failure } from "./protocol";

/** The start as it is with shared memory; that of a module for one thread takes none, and its types say so. */
const begin: (from: { module_or_path: InitInput; memory?: WebAssembly.Memory }) => Promise<InitOutput> = init;
let started = false;

/** Starts the module. */
export async function start(from: Parameters<typeof begin>[0]): Promise<InitOutput> {
  const made = await begin(from);
  started = true;
  return made;
}

/** The message of a panic on this thread, as far as the module can still say it. */
function panicked(): string | undefined {
  try {
    return started ? lastPanic() : undefined;
  } catch {
    return undefined;
  }
}

/** Why a call has failed; on the thread that it failed on. */
export function failure(error: unknown): Failure {
  const message = error instanceof Error ? error.message : String(error);
  if (error instanceof WebAssembly.RuntimeError || error instanceof RangeError) {
    // A trap without a panic: an allocation that failed.
    const panic = error instanceof WebAssembly.RuntimeError ? panicked() : undefined;
    if (panic === undefined && !/divide|bounds/.test(message)) {
      return { kind: "memory", message: "the memory that a page may use is full" };
    }
    return { kind: "crash", message: panic ?? message };
  }
  const kind = error instanceof Error && "kind" in error ? (error.kind as Failure["kind"]) : "crash";
  return { kind, message };
}
