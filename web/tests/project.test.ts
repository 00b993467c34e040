import { describe, expect, test } from "vitest";
import { logarithmic } from "../src/charts";
import { isProject, readProject, writeProject, type Project } from "../src/project";

const project: Project = {
  nurbskinProject: 1, version: "0.1.0", made: "fit",
  inputs: [{ name: "a.ply", bytes: 3, sha256: "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad" }],
  options: { tolerance: "0.1mm", unit: "mm" },
};

describe("a project", () => {
  test("is read as it was written", () => {
    const text = writeProject(project);
    expect(isProject(text)).toBe(true);
    expect(readProject(text)).toEqual(project);
  });

  test("that is damaged is refused in words", () => {
    expect(isProject('{"points": []}')).toBe(false);
    expect(() => readProject('{"nurbskinProject": 1')).toThrow(/damaged/);
    expect(() => readProject('{"nurbskinProject": 2}')).toThrow(/later version/);
    expect(() => readProject(writeProject({ ...project, inputs: [] }))).toThrow(/inputs/);
    expect(() => readProject(writeProject({ ...project, inputs: [{ name: "a", bytes: 1, sha256: "no" }] }))).toThrow(/inputs/);
  });
});

test("a logarithmic axis spans 0 to 1", () => {
  const places = logarithmic([1, 10, 100]);
  expect(places.map((x) => Number(x.toFixed(9)))).toEqual([0, 0.5, 1]);
  expect(logarithmic([5, 5])).toEqual([0.5, 0.5]);
});
