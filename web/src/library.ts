// The start of the library's module, and its end.

import init, { lastPanic, type InitInput, type InitOutput } from "nurbskin";
import type { Failure } from "./protocol";

/** Starts the module. One that is built for one thread takes no memory, and its types say so. */
export const start: (from: { module_or_path: InitInput; memory?: WebAssembly.Memory }) => Promise<InitOutput> = init;

/** Why a call has failed; on the thread that it failed on. */
export function failure(error: unknown): Failure {
  const message = error instanceof Error ? error.message : String(error);
  if (error instanceof WebAssembly.RuntimeError || error instanceof RangeError) {
    // A trap without a panic: an allocation that failed.
    const panic = error instanceof WebAssembly.RuntimeError ? lastPanic() : undefined;
    if (panic === undefined && !/divide|bounds/.test(message)) {
      return { kind: "memory", message: "the memory that a page may use is full" };
    }
    return { kind: "crash", message: panic ?? message };
  }
  const kind = error instanceof Error && "kind" in error ? (error.kind as Failure["kind"]) : "crash";
  return { kind, message };
}
