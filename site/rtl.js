// A frame of the RTL, in WebAssembly (tools/browser/rtl.cpp).

import { instantiate } from "./library.js";

const SLICE = 20000;

/** Renders a frame: `writes` are those of its registers. Calls `onSlice` with cycles and finished pixels. */
export async function renderRtl(code, manifest, { records, writes, width, height }, onSlice) {
  const rtl = await instantiate(code);
  const registers = new Map(manifest.registers.fields.map((field) => [field.name, field]));
  const bytes = manifest.records.bits / 8;
  const pointer = rtl.malloc(records.length);
  new Uint8Array(rtl.memory.buffer).set(records, pointer);
  rtl.rtl_load(pointer, records.length / bytes, bytes);
  rtl.free(pointer);
  for (const [address, value] of writes) rtl.rtl_write(address, value);
  rtl.rtl_begin(width, height, registers.get("control.start").address);
  const triangles = () => new Int32Array(rtl.memory.buffer, rtl.rtl_triangles(), width * height);
  const colours = () => new Uint16Array(rtl.memory.buffer, rtl.rtl_colours(), 3 * width * height);
  for (let cycles = 0, done = SLICE; done === SLICE; ) {
    done = rtl.rtl_run(SLICE);
    cycles += done;
    await onSlice({ cycles, colours: colours().slice(), triangles: triangles().slice() });
  }
  const counters = {};
  for (const { name, address, words } of registers.values())
    if (name.startsWith("counters."))
      counters[name.slice(9)] = rtl.rtl_read(address) + (words > 1 ? 2 ** 32 * rtl.rtl_read(address + 1) : 0);
  return { colours: colours().slice(), triangles: triangles().slice(), counters };
}
