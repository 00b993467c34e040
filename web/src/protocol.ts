// What the page and its worker say to each other.

import type {
  CompareOptions, ComparisonFigures, ErrorKind, FitFigures, FitOptions, Identity, Look, Scene, SimulateOptions,
} from "nurbskin";

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

/** What a task gives. */
export interface Answers {
  look: Look;
  simulate: { look: Look; bytes: ArrayBuffer };
  fit: { figures: FitFigures; scene: Scene };
  compare: { figures: ComparisonFigures; scene: Scene };
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
  | { id: number; answer: Answers[keyof Answers] }
  | { id: number; failure: Failure }
  | { id: number; stage: string; steps: number | null }
  | { id: number; advance: number }
  | { id: number; tell: string };
