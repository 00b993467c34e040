// A project: what it takes to make a result again, without the files themselves.

import type { CompareOptions, FitOptions, Identity } from "nurbskin";

/** The content of a project file. */
export interface Project {
  nurbskinProject: 1;
  version: string;
  made: "fit" | "compare";
  /** The scan; of a comparison, then the CAD file. */
  inputs: Identity[];
  options: FitOptions | CompareOptions;
}

/** The text of a project file. */
export function writeProject(project: Project): string {
  return `${JSON.stringify(project, null, 2)}\n`;
}

/** Whether the beginning of a file is that of a project. */
export function isProject(text: string): boolean {
  return /^\s*\{\s*"nurbskinProject"\s*:/.test(text);
}

/** A project file; an error in words if it is not one. */
export function readProject(text: string): Project {
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch {
    throw new Error("The project file is damaged: it is not JSON.");
  }
  const project = value as Partial<Project>;
  if (project.nurbskinProject !== 1) throw new Error("The project file was made by a later version of this page.");
  const { inputs, options, made } = project;
  const named = Array.isArray(inputs) && inputs.length > 0 && inputs.every((input) => typeof input.name === "string" && /^[0-9a-f]{64}$/.test(input.sha256));
  if (!named || typeof options !== "object" || (made !== "fit" && made !== "compare")) {
    throw new Error("The project file is damaged: its inputs or options are missing.");
  }
  return project as Project;
}
