// What the faces of a mesh are on a design: entries of its material table, and textures, colours or glass of the faces.

import { hasRegister } from "./design.js";
import { decode } from "./photo.js";

/**
 * As host/colonnade/mesh/materials/materials.py: the largest roughness of a metal that emits nothing, and is nearer to
 * a mirror.
 */
export const MIRROR_ROUGHNESS = 0.35;
const [SHARP_ROUGHNESS, GLASS_ROUGHNESS] = [0.25, 0.5];
/** Pixels of textures, together: more are halved; and of one mesh at most. */
const [KEPT_PIXELS, MOST_PIXELS] = [1 << 25, 1 << 29];

/** An emission with a largest channel of at most 1, and its hue. */
export const shownEmission = (emission) => emission.map((value) => value / Math.max(1, ...emission));

/** The share of light that microfacets reflect at once (docs/gather.md). */
export const microfacetAlbedo = (roughness) =>
  1 - roughness ** 4 / (0.25 + 0.9 * roughness ** 2 + 0.55 * roughness ** 4);

/** The pixels of a picture's bytes, red, green and blue, and their alpha; null if all are opaque. */
export async function decodedPicture(bytes) {
  const bitmap = await createImageBitmap(new Blob([bytes]), { premultiplyAlpha: "none", colorSpaceConversion: "none" });
  const { width, height } = bitmap;
  if (width * height > MOST_PIXELS) throw new Error("too large");
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  const alpha = Uint8Array.from({ length: width * height }, (_, i) => data[4 * i + 3]);
  return {
    width,
    height,
    alpha: alpha.some((value) => value < 255) ? alpha : null,
    pixels: Uint8Array.from({ length: 3 * width * height }, (_, i) => data[4 * Math.floor(i / 3) + (i % 3)]),
  };
}

/** The mesh with its textures' pictures decoded; surfaces of one that cannot be have their plain colours. */
export async function decodePictures(mesh, decodePicture) {
  for (const texture of mesh.textures ?? [])
    Object.assign(texture, texture.picture ? await decodePicture(texture.picture).catch(() => null) : null);
  const isMissing = (use) => use && !mesh.textures[use.texture].pixels;
  for (const material of mesh.materials ?? [])
    for (const name of ["base", "metal", "emissive", "relief"])
      if (isMissing(material[name])) {
        material[name] = null;
        mesh.notes.push(
          "pictures of textures are missing, damaged or of another format than PNG, JPEG and WebP: " +
            "their surfaces have plain colours",
        );
      }
  if (mesh.relief)
    mesh.relief.mapOf = mesh.relief.mapOf.map((map) => (map < 0 || isMissing(mesh.relief.maps[map]) ? -1 : map));
  keptWithin(mesh.textures ?? []);
  mesh.notes = [...new Set(mesh.notes)];
  return mesh;
}

/** Halves textures until they have no more pixels than are kept. */
export function keptWithin(textures) {
  while (textures.reduce((sum, { pixels }) => sum + (pixels?.length ?? 0) / 3, 0) > KEPT_PIXELS)
    textures.forEach(halve);
}

/** Every second pixel of a texture, as the mean of the four. */
function halve(texture) {
  const { width, height, pixels, alpha } = texture;
  if (!pixels) return;
  const [columns, rows] = [width, height].map((length) => Math.ceil(length / 2));
  const at = (x, y, channel) => pixels[3 * (Math.min(y, height - 1) * width + Math.min(x, width - 1)) + channel];
  const mean = (i) => {
    const [x, y, channel] = [2 * (Math.floor(i / 3) % columns), 2 * Math.floor(i / 3 / columns), i % 3];
    return (at(x, y, channel) + at(x + 1, y, channel) + at(x, y + 1, channel) + at(x + 1, y + 1, channel)) / 4;
  };
  const alphaAt = (x, y) => alpha[Math.min(y, height - 1) * width + Math.min(x, width - 1)];
  const alphaMean = (x, y) => (alphaAt(x, y) + alphaAt(x + 1, y) + alphaAt(x, y + 1) + alphaAt(x + 1, y + 1)) / 4;
  if (alpha)
    texture.alpha = Uint8Array.from({ length: columns * rows }, (_, i) =>
      alphaMean(2 * (i % columns), 2 * Math.floor(i / columns)),
    );
  Object.assign(texture, {
    width: columns,
    height: rows,
    pixels: Uint8Array.from({ length: 3 * columns * rows }, (_, i) => mean(i)),
  });
}

/** The mean linear colour of a texture. */
function meanOf(texture) {
  const sums = [0, 0, 0];
  texture.pixels.forEach((code, i) => (sums[i % 3] += decode(code)));
  return sums.map((sum) => (3 * sum) / texture.pixels.length);
}

/**
 * The material that a design shows of a file's (`as_rendered`, `in_layer`); metal of at least the roughness of a lobe
 * is "metal".
 */
function rendered(material, gathers, hasBounces) {
  const { kind, roughness, albedo } = material;
  if (!hasBounces || kind === "diffuse" || (kind === "mirror" && !gathers && roughness > MIRROR_ROUGHNESS))
    return { ...material, kind: "diffuse", roughness: 0 };
  if (!gathers) return { ...material, roughness: 0 };
  if (kind === "glass") return { ...material, roughness: Math.min(roughness, GLASS_ROUGHNESS) };
  return {
    ...material,
    kind: roughness < SHARP_ROUGHNESS ? "mirror" : "metal",
    albedo: albedo.map((value) => value * microfacetAlbedo(roughness)),
  };
}

/** An entry of the material table, in values that a message holds. */
const entryOf = ({ kind, roughness, ior, albedo, emission, coverage, isTextured, isCorner }) => ({
  kind,
  roughness,
  ior,
  albedo,
  emission,
  coverage,
  hasColours: isCorner && !isTextured,
  hasTexture: isTextured,
});

/** The areas of faces. */
export function areasOf({ vertices, faces }) {
  const at = (corner, axis) => vertices[3 * faces[corner] + axis];
  return Float64Array.from({ length: faces.length / 3 }, (_, face) => {
    const [a, b] = [1, 2].map((corner) => [0, 1, 2].map((axis) => at(3 * face + corner, axis) - at(3 * face, axis)));
    return Math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]) / 2;
  });
}

/**
 * The materials of a file on a design: `entries` of its table, as `rendered` has them, `surfaces` and `surfaceOf` for
 * Library.pack, and notes. `gathers` and `headroom` are those of the frame.
 */
export function surfacesOf(library, mesh, { manifest, gathers, headroom }) {
  const most = manifest.config.frame.materials;
  const notes = [];
  const [hasTextures, hasCorners, hasBounces] = [
    Boolean(manifest.texture),
    hasRegister(manifest, "materials[0].hasCornerColours"),
    manifest.config.frame.maxBounces > 0,
  ];
  const faces = mesh.materialOf;
  const found = mesh.materials.map((material) => (hasCorners ? material : (material.ofTexture ?? material)));
  const areas = new Float64Array(found.length);
  areasOf(mesh).forEach((area, face) => (areas[faces[face]] += area));
  const coloured = new Set(
    hasCorners ? faces.filter((number, face) => mesh.hasOwnColours[face] || found[number].ofTexture) : [],
  );
  const means = mesh.textures.map((texture) => (texture.pixels ? meanOf(texture) : null));
  const plain = found.map((material, number) => {
    const scaled = (colour, use) => (use ? colour.map((value, i) => value * means[use.texture][i]) : colour);
    const isTextured = Boolean(material.base) && hasTextures;
    if (material.base && !hasTextures) notes.push("this hardware has no textures: their surfaces have mean colours");
    const emission = shownEmission(scaled(material.emission, material.emissive));
    return {
      ...material,
      emission,
      isTextured,
      isCorner: coloured.has(number),
      paint: material.albedo,
      albedo: isTextured ? material.albedo : scaled(material.albedo, material.base),
    };
  });
  /** What materials differ in that share no entry: the colours of textures and corners are of no account. */
  const keyOf = ({ kind, ior, emission, coverage, isTextured, isCorner, albedo }) =>
    JSON.stringify([kind, kind === "glass" && ior, emission, coverage, isTextured, isTextured || isCorner || albedo]);
  const shown = (materials) => materials.map((material) => rendered(material, gathers, hasBounces));
  const distinct = (materials) =>
    new Set(materials.filter((_, i) => areas[i] > 0).map((one) => keyOf(one) + one.roughness)).size;
  // Plain colours that do not fit move to the corners
  const prepared =
    distinct(shown(plain)) > most && hasCorners ? plain.map((material) => ({ ...material, isCorner: true })) : plain;
  const merge = () => {
    const kinds = [...new Set(prepared.map(keyOf))];
    const merged = library.merged(
      prepared.map(({ roughness }) => roughness),
      areas,
      prepared.map((one) => kinds.indexOf(keyOf(one))),
      most,
    );
    const changed = prepared.filter((material, i) => material.roughness !== merged[i]).length;
    if (changed) notes.push(`the roughness of ${changed} materials is that of similar ones: this hardware has ${most}`);
    return prepared.map((material, i) => ({ ...material, roughness: merged[i] }));
  };
  const all = shown(distinct(shown(prepared)) > most ? merge() : prepared);
  const entries = [];
  const places = new Map();
  // As the host's table, or the largest first
  const rankOf = (number) => 4 * Number(areas[number] === 0) + Number(plain[number].isCorner);
  const isFull = distinct(all) > most;
  const order = [...all.keys()].sort((a, b) => (isFull ? areas[b] - areas[a] : rankOf(a) - rankOf(b)));
  const near = (a, b) =>
    4 * Number(a.hasTexture !== b.isTextured) +
    2 * Number(a.kind !== b.kind) +
    Math.abs(a.roughness - b.roughness) +
    a.albedo.reduce((sum, value, i) => sum + Math.abs(value - b.albedo[i]), 0) / 3;
  const surfaces = [];
  for (const number of order) {
    const material = all[number];
    const key = keyOf(material) + material.roughness;
    if (!places.has(key) && entries.length < most) places.set(key, entries.push(entryOf(material)) - 1);
    if (!places.has(key)) {
      const candidates = entries
        .map((entry, i) => ({ i, apart: near(entry, material) }))
        .sort((a, b) => a.apart - b.apart);
      places.set(key, candidates[0].i);
      if (areas[number] > 0)
        notes.push(`the mesh has more kinds of materials than this hardware: ${most}; small ones are like others`);
    }
    const entry = places.get(key);
    const isDiffuse = material.kind === "diffuse";
    surfaces[number] = {
      entry,
      isGlass: entries[entry].kind === "glass" || entries[entry].coverage < 0.5,
      texture: material.isTextured && entries[entry].hasTexture ? material.base.texture : -1,
      hasColours: entries[entry].hasColours,
      factor: (material.isTextured ? material.paint : material.albedo).map(
        (value) => value / (isDiffuse ? headroom : 1),
      ),
    };
  }
  return { entries, surfaces, surfaceOf: faces, notes: [...new Set(notes)] };
}
