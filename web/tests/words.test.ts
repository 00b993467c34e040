import { describe, expect, test } from "vitest";
import { bytesWords, counted, digits, failureWords, grouped, lengthWords, pictured, plain, readTolerance, sentence, sizeWords, stageWords, verdictWords } from "../src/words";

const MM = [{ from: 0, factor: 1, symbol: "mm" }, { from: 1e-4, factor: 1000, symbol: "um" }, { from: 0.1, factor: 1, symbol: "mm" }, { from: 1000, factor: 0.001, symbol: "m" }];

describe("numbers", () => {
  test("have three digits that mean something", () => {
    expect([0, 0.012345, 1.5, 123.456, 98765.4, -0.5].map((x) => digits(x))).toEqual(["0", "0.0123", "1.5", "123", "98\u202f765", "\u22120.5"]);
    expect(digits(1.5e-9)).toBe("1.50e\u22129");
    expect(digits(NaN)).toBe("–");
    expect(digits(99.53, 4)).toBe("99.53");
    expect(grouped("1234")).toBe("1234");
    expect(counted(1, "point", "points")).toBe("1 point");
    expect(counted(36000, "point", "points")).toBe("36\u202f000 points");
  });

  test("of lengths are in the unit that suits them", () => {
    expect(lengthWords(MM, 0.0568)).toBe("56.8 µm");
    expect(lengthWords(MM, -0.274)).toBe("\u22120.274 mm");
    expect(lengthWords(MM, 2500)).toBe("2.5 m");
    // Like the other end of a scale.
    expect(lengthWords(MM, 0.05, 0.5)).toBe("0.05 mm");
    expect(sizeWords([[0, 0, 0], [150, 200, 111]], "mm")).toBe("150 × 200 × 111 mm");
    expect(bytesWords(241_000)).toBe("241 kB");
  });

  test("of a unit are pictured", () => {
    const box: [number[], number[]] = [[0, 0, 0], [0.15, 0.1, 0.05]];
    expect(["mm", "m", "in"].map((unit) => pictured(box, unit as "mm"))).toEqual(["0.15 mm", "150 mm", "3.81 mm"]);
    expect(pictured([[0], [5000]], "m")).toBe("5 km");
  });
});

describe("words", () => {
  test("of the command become those of the page", () => {
    expect(plain("the scan looks like metres: say --unit m")).toBe("the scan looks like metres: choose “m” under “Unit”");
    expect(plain("the scan does not say its unit: mm is assumed (say --unit)")).toBe("the scan does not say its unit: mm is assumed (choose it under “Unit”)");
    expect(plain("say --align if the scan is not in the nominal's coordinates")).toBe("align the scan to the CAD file if the scan is not in the nominal's coordinates");
    expect(plain("look at the place in the report (--report part.html)")).toBe("look at the marked places");
    expect(plain("-t 0.2mm would take about 640 control points, -t 50um about 15 000")).toBe("a tolerance of 0.2mm would take about 640 control points, a tolerance of 50um about 15 000");
    expect(plain("all 8000 points are within +-0.5 mm; the noise is 50.8 um")).toBe("all 8000 points are within ±0.5 mm; the noise is 50.8 µm");
    expect(plain("a point-by-point list")).toBe("a point-by-point list");
  });

  test("are sentences", () => {
    expect(sentence("the file is empty")).toBe("The file is empty.");
    expect(sentence("Done!")).toBe("Done!");
    expect(stageWords("clean")).toBe("Cleaning the points");
    expect(stageWords("polish")).toBe("Polish");
    expect(verdictWords("fail", "compare")).toBe("Not within tolerance");
  });

  test("of failures say what to do", () => {
    expect(failureWords({ kind: "memory", message: "" })).toMatch(/memory .* full\. Close other tabs/);
    expect(failureWords({ kind: "crash", message: "index 3" })).toMatch(/index 3.*report it/);
    expect(failureWords({ kind: "read", message: "a.ply, line 2: no number" })).toBe("a.ply, line 2: no number.");
  });
});

describe("a tolerance", () => {
  test("is a number above zero, with a point or a comma, or nothing", () => {
    expect(readTolerance(" 0,05 ", "mm")).toEqual({ tolerance: "0.05mm" });
    expect(readTolerance("20", "um")).toEqual({ tolerance: "20um" });
    expect(readTolerance("", "mm")).toEqual({});
    for (const wrong of ["-1", "0", "1mm", "abc"]) expect(readTolerance(wrong, "mm").error).toMatch(/above zero/);
  });
});
