// The memory that a module imports. A module that is built for threads asks for shared memory, which a page gets only where it is
// cross-origin isolated. Elsewhere the same module takes memory of its own, if that is what it asks for: its atomic operations
// do the same there, and only waiting for another thread would end it, which one thread alone does not. So the page has one
// module for both. (Core specification of WebAssembly with threads, 5.4.4 imports, 5.3.8 limits.)

/** The limits of an imported memory. */
export interface Limits {
  /** Where the byte with the kind of the limits is. */
  at: number;
  /** Pages of 64 KiB that the module begins with, and that it can have at most. */
  minimum: number;
  maximum: number;
}

/** Bytes of a page of memory: WebAssembly fixes it. */
export const PAGE = 65536;

/** Magic number and version, before the first section. */
const HEAD = 8;
const IMPORT_SECTION = 2;
/** The kinds of imports. */
const FUNCTION = 0, TABLE = 1, MEMORY = 2, GLOBAL = 3, TAG = 4;
/** Bits of the kind of limits: there is a maximum; the memory is shared. */
const HAS_MAXIMUM = 1, SHARED = 2;
/** What a memory of 32-bit addresses without a maximum can have, pages. */
const MOST_PAGES = 65536;

/** The limits of the memory that a module imports; null where it brings its own. */
export function importedMemory(module: Uint8Array): Limits | null {
  let at = HEAD;
  const byte = (): number => {
    const value = module[at++];
    if (value === undefined) throw new RangeError("the module is cut off");
    return value;
  };
  /** An unsigned number, seven bits to the byte, the lowest first. */
  const number = (): number => {
    for (let value = 0, unit = 1; ; unit *= 128) {
      const part = byte();
      value += (part % 128) * unit;
      if (part < 128) return value;
    }
  };
  const skipName = (): void => { const length = number(); at += length; };
  const limits = (): Limits => {
    const begin = at, kind = byte(), minimum = number();
    return { at: begin, minimum, maximum: kind & HAS_MAXIMUM ? number() : MOST_PAGES };
  };
  while (at < module.length) {
    const section = byte(), length = number(), end = at + length;
    if (section !== IMPORT_SECTION) {
      at = end;
      continue;
    }
    for (let left = number(); left > 0; left--) {
      skipName();
      skipName();
      switch (byte()) {
        case FUNCTION: number(); break;
        case TABLE: byte(); limits(); break;
        case MEMORY: return limits();
        case GLOBAL: at += 2; break;
        case TAG: byte(); number(); break;
        default: throw new RangeError("the module has an import of an unknown kind");
      }
    }
    return null;
  }
  return null;
}

/** Lets the module import memory that is not shared. */
export function unshare(module: Uint8Array, { at }: Limits): void {
  module[at] = (module[at] ?? 0) & ~SHARED;
}
