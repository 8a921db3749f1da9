// The materials of a glTF document, as host/colonnade/mesh/materials/materials.py and files/gltf_textures.py read them,
// with the pictures of their textures, which decodePictures (surfaces.js) decodes.

import { MIRROR_ROUGHNESS, shownEmission } from "./surfaces.js";

const [IOR, MOST_IOR, BRIGHTEST] = [1.5, 4, 1e6];
const METAL = 0.5;
const WRAPS = new Map([
  [33648, 1],
  [33071, 2],
]);
const NEAREST = 9728;
const USED = ["transmission", "ior", "emissive_strength", "pbrSpecularGlossiness", "unlit"].map(
  (name) => `KHR_materials_${name}`,
);

const clamped = (value, most = 1) => Math.max(0, Math.min(most, value));
const number = (value, otherwise) => (Number.isFinite(value) ? value : otherwise);
const colour = (values, otherwise, most = 1) =>
  Array.isArray(values) && values.length >= 3
    ? otherwise.map((value, i) => clamped(number(values[i], value), most))
    : otherwise;

export class GltfMaterials {
  /** `notes`: a set that takes what pictures do not show. */
  constructor(document, notes) {
    this.document = document;
    this.notes = notes;
    this.materials = [];
    this.textures = [];
    /** Normal maps: their number in `textures`, and the factor of their tangential components. */
    this.maps = [];
    /** By use: the number in `materials`, and in `textures`. */
    this.numbers = new Map();
    this.places = new Map();
  }

  /** The number in `materials` of that of a primitive, which may have none. */
  numberOf(index) {
    if (!this.numbers.has(index)) {
      this.numbers.set(index, this.materials.length);
      this.materials.push(
        index === undefined
          ? { kind: "diffuse", albedo: [0.8, 0.8, 0.8], roughness: 0, ior: IOR, emission: [0, 0, 0] }
          : this.read(this.document.entry("materials", index)),
      );
    }
    return this.numbers.get(index);
  }

  /** The number of a material without the textures for which a primitive has no positions. */
  without(number, base, metal, emissive) {
    const found = {
      ...this.materials[number],
      ...(base ? { base: null } : {}),
      ...(metal ? { metal: null } : {}),
      ...(emissive ? { emitsMean: true } : {}),
    };
    return this.materials.push(found) - 1;
  }

  /**
   * A material; `base`, `metal`, `emissive` and `relief` are the uses of its textures, or null; `factors` those of
   * metal and roughness.
   */
  read(material) {
    const { extensions = {} } = material;
    const extension = (name) => extensions[`KHR_materials_${name}`] ?? {};
    const surface = this.surfaceOf(material, extensions);
    const [metallic, roughness] = [number(surface.metallicFactor, 1), clamped(number(surface.roughnessFactor, 1))];
    const albedo = colour(surface.baseColorFactor, [1, 1, 1]);
    const strength = clamped(number(extension("emissive_strength").emissiveStrength, 1), BRIGHTEST);
    const emitted = colour(material.emissiveFactor, [0, 0, 0], BRIGHTEST).map((value) => strength * value);
    const emissive = emitted.some(Boolean) ? this.use(material.emissiveTexture) : null;
    const emission = emissive ? emitted : shownEmission(emitted);
    if (Math.max(...emitted) > 1) this.notes.add("emission above 1 is scaled to 1");
    if (extensions.KHR_materials_unlit) this.notes.add("unlit materials are lit: matt surfaces have their base colour");
    const given = number(extension("ior").ior, IOR);
    const alpha = this.alphaOf(material, surface);
    const isGlass = number(extension("transmission").transmissionFactor, 0) > 0.5;
    const [base, metal] = [surface.baseColorTexture, surface.metallicRoughnessTexture].map((info) => this.use(info));
    const isMetal = !surface.metallicRoughnessTexture && metallic >= METAL;
    if (material.occlusionTexture) this.notes.add("occlusion maps are left out: ambient light reaches all surfaces");
    for (const name of Object.keys(extensions)) if (!USED.includes(name)) this.notes.add(`${name} is ignored`);
    return {
      kind: isGlass ? "glass" : isMetal ? "mirror" : "diffuse",
      albedo: isGlass && alpha?.blends ? albedo.map((value) => 1 - alpha.factor * (1 - value)) : albedo,
      alpha: isGlass ? null : alpha,
      coverage: 1,
      ior: given > 1 ? Math.min(given, MOST_IOR) : IOR,
      roughness: isGlass || isMetal ? roughness : 0,
      emission: isMetal && roughness <= MIRROR_ROUGHNESS ? [0, 0, 0] : emission,
      base,
      metal: isGlass ? null : metal,
      factors: [metallic, number(surface.roughnessFactor, 1)],
      relief: this.relief(material.normalTexture),
      emissive,
    };
  }

  /** The alpha of a material: factor, what is shown from `cutoff` on, and whether it blends; or null. */
  alphaOf({ alphaMode, alphaCutoff }, { baseColorFactor }) {
    if (!["MASK", "BLEND"].includes(alphaMode)) return null;
    const cutoff = alphaMode === "MASK" ? number(alphaCutoff, 0.5) : 0.5;
    return {
      factor: clamped(number(baseColorFactor?.[3], 1)),
      cutoff: Math.max(0, Math.min(2, cutoff)),
      blends: alphaMode === "BLEND",
    };
  }

  /** The metallic-roughness part of a material, or what stands for it. @param {any} material @returns {any} */
  surfaceOf(
    { pbrMetallicRoughness: surface = { metallicFactor: 0 } },
    { KHR_materials_unlit: unlit, KHR_materials_pbrSpecularGlossiness: older },
  ) {
    if (unlit)
      return {
        baseColorFactor: surface.baseColorFactor,
        baseColorTexture: surface.baseColorTexture,
        metallicFactor: 0,
        roughnessFactor: 1,
      };
    if (!older) return surface;
    const { glossinessFactor, diffuseFactor, diffuseTexture } = older;
    return {
      metallicFactor: 0,
      roughnessFactor: 1 - number(glossinessFactor, 1),
      baseColorFactor: diffuseFactor,
      baseColorTexture: diffuseTexture,
    };
  }

  /** The use of a normal map, with its number in `maps`; or null. */
  relief(info) {
    const found = this.use(info);
    return found && { ...found, map: this.maps.push({ texture: found.texture, scale: number(info.scale, 1) }) - 1 };
  }

  /**
   * The use of a texture: its number in `textures`, the name of the positions in it, and a function from the file's; or
   * null.
   */
  use(info) {
    if (!info) return null;
    const { document } = this;
    const entry = document.entry("textures", info.index);
    const source = entry.extensions?.EXT_texture_webp?.source ?? entry.source;
    if (source === undefined) {
      this.notes.add("textures whose pictures are not PNG, JPEG or WebP are left out");
      return null;
    }
    const { wrapS, wrapT, magFilter } = entry.sampler === undefined ? {} : document.entry("samplers", entry.sampler);
    const [wrapU, wrapV, isNearest] = [WRAPS.get(wrapS) ?? 0, WRAPS.get(wrapT) ?? 0, Number(magFilter === NEAREST)];
    const key = [source, wrapU, wrapV, isNearest].join();
    if (!this.places.has(key)) {
      this.places.set(key, this.textures.length);
      this.textures.push({ picture: document.image(source), wrapU, wrapV, isNearest });
    }
    const { texCoord, offset = [0, 0], rotation = 0, scale = [1, 1] } = info.extensions?.KHR_texture_transform ?? {};
    if (![...offset, rotation, ...scale].every(Number.isFinite))
      throw document.error("the transform of a texture is not valid: export it again");
    const [cosine, sine] = [Math.cos(rotation), Math.sin(rotation)];
    const place = ([u, v]) => [
      cosine * scale[0] * u + sine * scale[1] * v + offset[0],
      -sine * scale[0] * u + cosine * scale[1] * v + offset[1],
    ];
    return { texture: this.places.get(key), coordinates: `TEXCOORD_${texCoord ?? info.texCoord ?? 0}`, place };
  }
}
