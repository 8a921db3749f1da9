// A design as its manifest describes it: the lines that colonnade_model_open reads, and writes of registers.

/** The hash of a design's formats. */
export const hashWords = ({ formatHash }) =>
  Array.from({ length: 8 }, (_, i) => parseInt(formatHash.slice(8 * i, 8 * i + 8), 16));

/** The lines of host/cpp/library/colonnade_model.h for a manifest. */
export function designLines(manifest) {
  const { geometry, columnBvhMemory } = manifest.config;
  const numbers = {
    ...manifest.numbers,
    bvh: Number(geometry.bvh),
    stackDepth: columnBvhMemory.stackDepth,
    recordBits: manifest.records.bits,
    depth: manifest.memories.columnBvh.depth,
    ...Object.fromEntries(hashWords(manifest).map((word, i) => [`formatHash${i}`, word])),
  };
  const lines = Object.entries(numbers).map(([name, value]) => `number ${name} ${value}`);
  for (const [record, fields] of Object.entries(manifest.records.layouts))
    for (const field of fields)
      lines.push(`layout ${record} ${field.name} ${field.offset} ${field.width} ${Number(field.signed)}`);
  for (const register of manifest.registers.fields)
    if (register.access === "rw")
      lines.push(
        `register ${register.name} ${register.address} ${register.words} ${register.width} ` +
          `${Number(register.signed)} ${register.limit ?? -1}`,
      );
  for (const [kinds, memory] of [
    [["size", "map"], manifest.attributes],
    [["textureSize", "textureMap"], manifest.texture],
  ]) {
    for (const [name, value] of Object.entries(memory?.sizes ?? {})) lines.push(`${kinds[0]} ${name} ${value}`);
    for (const [record, fields] of Object.entries(memory?.layouts ?? {}))
      for (const field of fields)
        lines.push(`${kinds[1]} ${record} ${field.name} ${field.offset} ${field.width} ${Number(field.signed)}`);
  }
  return lines.join("\n");
}

/** The pairs of word address and value that set registers; names that the design lacks are left out. */
export function registerWrites(manifest, values) {
  const fields = new Map(manifest.registers.fields.map((field) => [field.name, field]));
  const writes = [];
  for (const [name, value] of Object.entries(values)) {
    const field = fields.get(name);
    if (!field) continue;
    const bits = BigInt.asUintN(field.width, BigInt(value));
    for (let word = 0; word < field.words; ++word)
      writes.push([field.address + word, Number((bits >> BigInt(32 * word)) & 0xffffffffn)]);
  }
  return writes;
}

/** Whether the design has a register. */
export const hasRegister = (manifest, name) => manifest.registers.fields.some((field) => field.name === name);
