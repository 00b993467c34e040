import { describe, expect, test } from "vitest";
import { importedMemory, unshare } from "../src/memory";

const name = (text: string): number[] => [text.length, ...Buffer.from(text)];
const section = (id: number, content: number[]): number[] => [id, content.length, ...content];
/** A module with these sections. */
const module = (...sections: number[][]): Uint8Array<ArrayBuffer> => new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0, ...sections.flat()]);

/** A type without parameters; a custom section before all. */
const before = [section(0, name("note")), section(1, [1, 0x60, 0, 0])];
/** A function, a table and a global before the memory: 18 pages at first, 16 384 at most. */
const imports = (kind: number): number[] => section(2, [
  4,
  ...name("a"), ...name("f"), 0, 0,
  ...name("a"), ...name("t"), 1, 0x70, 0, 1,
  ...name("a"), ...name("g"), 3, 0x7f, 0,
  ...name("a"), ...name("memory"), 2, kind, 18, 0x80, 0x80, 1,
]);
/** The module's own function, which adds 1 to a number in memory, atomically. */
const adds = [
  section(3, [1, 0]),
  section(7, [1, ...name("add"), 0, 1]),
  section(10, [1, 11, 0, 0x41, 0, 0x41, 1, 0xfe, 0x1e, 2, 0, 0x1a, 0x0b]),
];

describe("the memory of a module", () => {
  test("is found behind other imports", () => {
    const found = importedMemory(module(...before, imports(3)));
    expect(found).toMatchObject({ minimum: 18, maximum: 16384 });
    expect(importedMemory(module(...before))).toBeNull();
    expect(() => importedMemory(module([2, 5, 1, 1]))).toThrow("cut off");
  });

  test("need not be shared, and atomic operations go on", async () => {
    const bytes = module(...before, imports(3), ...adds);
    const limits = importedMemory(bytes);
    if (!limits) throw new Error("no memory");
    unshare(bytes, limits);
    expect(bytes).toEqual(module(...before, imports(1), ...adds));
    const memory = new WebAssembly.Memory({ initial: limits.minimum, maximum: limits.maximum });
    const { instance } = await WebAssembly.instantiate(bytes, {
      a: { f: () => undefined, t: new WebAssembly.Table({ element: "anyfunc", initial: 1 }), g: 0, memory },
    });
    (instance.exports.add as () => void)();
    expect(new Int32Array(memory.buffer)[0]).toBe(1);
  });
});
