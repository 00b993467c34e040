// What the page and its worker say to each other.

import type {
  CompareOptions, ComparisonFigures, ErrorKind, FitFigures, FitOptions, Identity, Look, Scene, SimulateOptions,
} from "nurbskin";

/** The first message to the worker: how it loads the library. */
export interface Begin {
  /** Threads, where memory can be shared; else there is one. */
  threads: number;
  /** Bytes that the library may use; null for as many as the module can address. */
  memory: number | null;
}

/** What a worker needs to be a thread of the library. */
export interface Joining {
  module: WebAssembly.Module;
  memory: WebAssembly.Memory;
}

/** Wanted by the worker: so many others that join it. */
export interface Pool extends Joining {
  count: number;
}

/** A task for the worker. Files and results are named by numbers that the page gives. */
export type Task =
  | { do: "look"; file: number; name: string; bytes: ArrayBuffer }
  | { do: "simulate"; file: number; name: string; shape: string; options: SimulateOptions }
  | { do: "fit"; file: number; options: FitOptions }
  | { do: "compare"; file: number; cad: number; options: CompareOptions }
  | { do: "save"; name: string }
  | { do: "identity"; file: number }
  | { do: "check"; file: number }
  | { do: "forget"; file: number };

/** A task with the number of its answer, and the flag that cancels it where memory can be shared. */
export type Ask = Task & { id: number; flag?: SharedArrayBuffer };

/** Threads of the library, and bytes that it has needed at most since it was loaded. */
export interface Cost {
  threads: number;
  bytes: number;
}

/** What a task gives. */
export interface Answers {
  look: Look;
  simulate: { look: Look; bytes: ArrayBuffer };
  fit: { figures: FitFigures; scene: Scene; cost: Cost };
  compare: { figures: ComparisonFigures; scene: Scene; cost: Cost };
  save: ArrayBuffer;
  identity: Identity;
  check: Record<string, unknown>;
  forget: null;
}

/** Why a task has failed. `memory` and `crash` end the worker. */
export interface Failure {
  kind: ErrorKind | "memory" | "crash";
  message: string;
}

/** What the worker sends. */
export type Reply =
  | { pool: Pool }
  | { id: number; answer: Answers[keyof Answers] }
  | { id: number; failure: Failure }
  | { id: number; stage: string; steps: number | null }
  | { id: number; advance: number }
  | { id: number; tell: string };
