// Prepares the faces of a file as the host does: metal and emission by maps, then without what alpha hides
// (host/colonnade/mesh/materials/ coverage.py), then swatches at the corners of faces (swatches.py).

import { areasOf, MIRROR_ROUGHNESS, shownEmission } from "./surfaces.js";

/**
 * As host/colonnade/mesh/geometry/topology.py: faces of a mesh that is split, and edges that are not, as part of the
 * mesh.
 */
const [MOST_SPLIT_FACES, SMALLEST_SPLIT] = [49152, 1 / 400];
/**
 * As host/colonnade/mesh/files/gltf_emission.py: the part of the faces that a mesh may have more which emission takes.
 */
const EMISSION_SHARE = 4;
/** As host/colonnade/mesh/files/gltf_metal.py: metal that emits at least so much has this roughness. */
const [GLOW, GLOWING_ROUGHNESS] = [1 / 8, 3 / 8];
/** Blended faces of less alpha are not shown. */
const THIN = 0.05;
const WHOLE_FACE = Float64Array.of(1, 0, 0, 0, 1, 0, 0, 0, 1);

/** Values of some faces, so many each. */
const valuesOf = (values, faces, width) => {
  const found = new Float64Array(width * faces.length);
  faces.forEach((face, i) => found.set(values.subarray(width * face, width * (face + 1)), width * i));
  return found;
};

const facesOf = (mesh, ...numbers) =>
  [...mesh.materialOf.keys()].filter((face) => numbers.includes(mesh.materialOf[face]));

/** The mesh of a file with materials, prepared for surfacesOf; another one is left. */
export function prepared(library, mesh) {
  if (!mesh.materials) return mesh;
  const placed = withMetal(library, mesh.clip ? atRest(library, mesh) : mesh);
  const found = swatched(library, withoutAlpha(library, withMaps(library, bisected(library, placed))));
  return { ...found, notes: [...new Set(found.notes)] };
}

/**
 * A mesh whose vertices are where its clip binds them, in its rest pose; `parts`: the faces of the file, and what each
 * face is of one (Library.pack).
 */
function atRest(library, mesh) {
  const { vertices, normals, isMirrored } = library.rest(mesh);
  /** Values of corners, so many each, backwards on mirrored faces. */
  const ordered = (values, width) =>
    values?.map((value, at) => {
      const [corner, part] = [Math.floor(at / width), at % width];
      return isMirrored[Math.floor(corner / 3)]
        ? values[width * (3 * Math.floor(corner / 3) + 2 - (corner % 3)) + part]
        : value;
    });
  const widths = { faces: 1, normals: 3, colours: 3, alphas: 1, uvs: 2, emissiveUvs: 2 };
  const found = Object.fromEntries(
    Object.entries(widths).map(([name, width]) => [name, ordered(name === "normals" ? normals : mesh[name], width)]),
  );
  const { faces } = found;
  const parts = {
    faces,
    owners: Int32Array.from(mesh.materialOf.keys()),
    weights: Float64Array.from({ length: 3 * faces.length }, (_, at) => WHOLE_FACE[at % 9]),
  };
  return {
    ...mesh,
    ...found,
    vertices,
    parts,
    relief: mesh.relief && { ...mesh.relief, uvs: ordered(mesh.relief.uvs, 2) },
  };
}

/** The mesh with `isMetal` and `roughness` of the faces that a map makes metal or not. */
function withMetal(library, mesh) {
  const [isMetal, roughness] = [new Int32Array(mesh.materialOf.length), new Float64Array(mesh.materialOf.length)];
  mesh.materials.forEach(({ metal, kind, factors }, number) => {
    if (!metal || kind !== "diffuse") return;
    const own = facesOf(mesh, number);
    const found = library.metal(mesh.textures[metal.texture], valuesOf(mesh.metalUvs, own, 6), factors);
    own.forEach((face, i) => ([isMetal[face], roughness[face]] = [found.isMetal[i], found.roughness[i]]));
  });
  return { ...mesh, isMetal, roughness };
}

/** Whether faces of a material emit by a map. */
const emitsByMap = (material) => material.emissive && !material.emitsMean && material.emission.some(Boolean);

/** The mesh with pieces of faces on which the emission by a map varies, and of their neighbours. */
function bisected(library, mesh) {
  let found = mesh;
  mesh.materials.forEach((material, number) => {
    if (!emitsByMap(material) || !found.materialOf.includes(number)) return;
    const shows = Uint8Array.from(found.materialOf, (own) => Number(own === number));
    const budget = Math.floor((MOST_SPLIT_FACES - shows.length) / EMISSION_SHARE);
    const { owners, weights } = library.emissionPieces(
      mesh.textures[material.emissive.texture],
      material.emission,
      found,
      shows,
      found.emissiveUvs,
      budget,
    );
    if (owners.length > shows.length)
      found = split(
        found,
        cornersOf(found),
        [...owners].map((owner, i) => ({ owner, weights: weights.subarray(9 * i, 9 * i + 9) })),
      );
  });
  return found;
}

/** The positions of the corners of faces. */
function cornersOf({ vertices, faces }) {
  const corners = new Float64Array(3 * faces.length);
  faces.forEach((vertex, corner) => corners.set(vertices.subarray(3 * vertex, 3 * vertex + 3), 3 * corner));
  return corners;
}

/**
 * The mesh with the materials that metallic-roughness and emission maps make of its faces, numbered as the host does.
 */
function withMaps(library, mesh) {
  const { materials, isMetal, roughness, emissiveUvs, textures } = mesh;
  const found = [...materials];
  const materialOf = Int32Array.from(mesh.materialOf);
  const areas = areasOf(mesh);
  materials.forEach((material, number) => {
    const hasMetal = material.metal && material.kind === "diffuse";
    const emits = emitsByMap(material);
    if (!hasMetal && !emits) return;
    const own = facesOf(mesh, number);
    const shares =
      emits &&
      library.emission(textures[material.emissive.texture], valuesOf(emissiveUvs, own, 6), valuesOf(areas, own, 1));
    const emissionOf = (i) =>
      shownEmission(material.emission.map((value, channel) => value * (shares ? shares[3 * i + channel] : 1)));
    if (emits) found[number] = { ...material, emissive: null, emission: [0, 0, 0] };
    const rows = own.map((_, i) => [
      ...(hasMetal ? [isMetal[own[i]], roughness[own[i]]] : []),
      ...(shares ? emissionOf(i) : []),
    ]);
    const order = [...own.keys()].sort(
      (a, b) => rows[a].map((value, column) => value - rows[b][column]).find(Boolean) ?? 0,
    );
    const numbers = new Map();
    for (const i of order) {
      const isOfMetal = hasMetal && isMetal[own[i]] === 1;
      const glows = isOfMetal && Math.max(...emissionOf(i)) >= GLOW;
      const rough = isOfMetal && (glows ? GLOWING_ROUGHNESS : roughness[own[i]]);
      const emission = isOfMetal && rough <= MIRROR_ROUGHNESS ? [0, 0, 0] : emissionOf(i);
      if (!isOfMetal && !emission.some((value, channel) => value !== found[number].emission[channel])) continue;
      const key = [rough, ...emission].join();
      if (!numbers.has(key))
        numbers.set(
          key,
          found.push({ ...found[number], emission, ...(isOfMetal ? { kind: "mirror", roughness: rough } : {}) }) - 1,
        );
      materialOf[own[i]] = numbers.get(key);
    }
  });
  return { ...mesh, materials: found, materialOf };
}

/** The mesh without what its materials' alpha hides. */
function withoutAlpha(library, mesh) {
  if (!mesh.materials.some(({ alpha }) => alpha)) return mesh;
  const materials = mesh.materials.map((material) => ({ ...material, alpha: null }));
  const textures = [...mesh.textures];
  const notes = [...mesh.notes];
  const whole = [];
  const parts = [];
  const panes = [];
  const corners = cornersOf(mesh);
  const edge = SMALLEST_SPLIT * Math.max(...[0, 1, 2].map((axis) => extent(mesh.vertices, axis)));
  let budget = MOST_SPLIT_FACES - mesh.materialOf.length;
  // Materials that differ in other than alpha and its picture share the faces that pieces may add
  const groups = new Map();
  mesh.materials.forEach(({ alpha, base }, number) => {
    const key = JSON.stringify([alpha, alpha && base?.texture]);
    groups.set(key, [...(groups.get(key) ?? []), number]);
  });
  for (const numbers of groups.values()) {
    const faces = facesOf(mesh, ...numbers);
    const { alpha, base } = mesh.materials[numbers[0]];
    const texture = base ? mesh.textures[base.texture] : null;
    const alphas = mesh.alphas ? valuesOf(mesh.alphas, faces, 3) : new Float64Array(3 * faces.length).fill(1);
    if (!alpha || !faces.length) {
      for (const face of faces) whole.push(face);
      continue;
    }
    const isCovering = alpha.blends && alpha.factor > 0;
    if (isCovering) for (const number of numbers) materials[number].coverage = alpha.factor;
    if (!texture?.alpha && alphas.every((value) => value === 1)) {
      if (isCovering || alpha.factor >= alpha.cutoff) for (const face of faces) whole.push(face);
      continue;
    }
    const values = [isCovering ? 1 : alpha.factor, alpha.cutoff, alpha.blends ? alpha.factor : -1, edge];
    const cut = library.cut({
      corners: valuesOf(corners, faces, 9),
      uvs: valuesOf(mesh.uvs, faces, 6),
      alphas,
      texture,
      values,
      budget: Math.max(0, budget),
    });
    faces.forEach((face, i) => {
      if (cut.kinds[i] > 0) whole.push(face);
      if (cut.kinds[i] < 0 && alpha.blends && cut.panes[4 * i] >= THIN)
        panes.push({ face, alpha: cut.panes[4 * i], colour: cut.panes.subarray(4 * i + 1, 4 * i + 4) });
    });
    cut.owners.forEach((owner, i) =>
      parts.push({ owner: faces[owner], weights: cut.weights.subarray(9 * i, 9 * i + 9) }),
    );
    budget -= cut.owners.length - cut.kinds.filter((kind) => kind === 0).length;
    if (cut.isCoarse) notes.push("outlines of alpha have more detail than faces");
    if (cut.isBlended) notes.push("blended alpha is rounded: from one half on it is opaque");
    if (cut.filled) {
      const filled = textures.push({ ...texture, pixels: cut.filled, alpha: null }) - 1;
      for (const number of numbers) materials[number].base = { ...mesh.materials[number].base, texture: filled };
    }
  }
  const found = { ...mesh, materials, textures, notes, materialOf: Int32Array.from(mesh.materialOf) };
  const tints = new Map();
  for (const { face, alpha, colour } of panes) {
    const { albedo } = mesh.materials[mesh.materialOf[face]];
    const own =
      mesh.colours && mesh.hasOwnColours[face]
        ? [0, 1, 2].map(
            (channel) => [0, 1, 2].reduce((sum, corner) => sum + mesh.colours[9 * face + 3 * corner + channel], 0) / 3,
          )
        : [...colour];
    const tint = own.map((value, channel) => Math.round(1000 * (1 - alpha + alpha * value * albedo[channel])) / 1000);
    if (!tints.has(tint.join()))
      tints.set(
        tint.join(),
        materials.push({ kind: "glass", albedo: tint, ior: 1, roughness: 0, emission: [0, 0, 0], coverage: 1 }) - 1,
      );
    found.materialOf[face] = tints.get(tint.join());
    whole.push(face);
  }
  const pieces = [...whole.sort((a, b) => a - b).map((owner) => ({ owner, weights: WHOLE_FACE })), ...parts].sort(
    (a, b) => a.owner - b.owner,
  );
  if (!pieces.length)
    throw new Error(`mesh ${mesh.name}: all its faces are transparent by their alpha: export it with alphaMode OPAQUE`);
  return { ...split(found, corners, pieces), alphas: null };
}

function extent(vertices, axis) {
  let [low, high] = [Infinity, -Infinity];
  for (let i = axis; i < vertices.length; i += 3)
    [low, high] = [Math.min(low, vertices[i]), Math.max(high, vertices[i])];
  return high - low;
}

/** The mesh of pieces of its faces; `corners` are the positions of these. */
function split(mesh, corners, pieces) {
  /** Values of three corners of each piece, so many each. */
  const interpolated = (values, width) => {
    if (!values) return values;
    const found = new Float64Array(3 * width * pieces.length);
    pieces.forEach(({ owner, weights }, i) => {
      const from = 3 * width * owner;
      for (let at = 0; at < 3 * width; ++at) {
        const [corner, part] = [Math.floor(at / width), at % width];
        found[3 * width * i + at] =
          weights[3 * corner] * values[from + part] +
          weights[3 * corner + 1] * values[from + width + part] +
          weights[3 * corner + 2] * values[from + 2 * width + part];
      }
    });
    return found;
  };
  const ofOwners = (values) => values && Int32Array.from(pieces, ({ owner }) => values[owner]);
  const positions = interpolated(corners, 3);
  const vertices = [...mesh.vertices];
  const faces = Int32Array.from({ length: 3 * pieces.length }, (_, at) => {
    const { owner, weights } = pieces[Math.floor(at / 3)];
    const kept = [0, 1, 2].find((corner) => weights[3 * (at % 3) + corner] === 1);
    // Corners that are kept keep their vertex
    return kept === undefined
      ? vertices.push(...positions.subarray(3 * at, 3 * at + 3)) / 3 - 1
      : mesh.faces[3 * owner + kept];
  });
  const { relief } = mesh;
  return {
    ...mesh,
    vertices: Float64Array.from(vertices),
    faces,
    normals: interpolated(mesh.normals, 3),
    colours: interpolated(mesh.colours, 3),
    uvs: interpolated(mesh.uvs, 2),
    isMetal: ofOwners(mesh.isMetal),
    roughness: mesh.roughness && Float64Array.from(pieces, ({ owner }) => mesh.roughness[owner]),
    emissiveUvs: interpolated(mesh.emissiveUvs, 2),
    alphas: interpolated(mesh.alphas, 1),
    materialOf: ofOwners(mesh.materialOf),
    hasOwnColours: ofOwners(mesh.hasOwnColours),
    relief: relief && {
      ...relief,
      mapOf: ofOwners(relief.mapOf),
      uvs: interpolated(relief.uvs, 2),
      tangents: interpolated(relief.tangents, 4),
    },
    parts: mesh.parts && {
      ...mesh.parts,
      owners: ofOwners(mesh.parts.owners),
      weights: interpolated(mesh.parts.weights, 3),
    },
  };
}

/** The mesh with the colours of its textures at the corners of faces that show a single texel or colour. */
function swatched(library, mesh) {
  const materials = [...mesh.materials];
  const materialOf = Int32Array.from(mesh.materialOf);
  const colours = mesh.colours ? Float64Array.from(mesh.colours) : new Float64Array(3 * mesh.faces.length).fill(1);
  let hasSwatches = false;
  mesh.materials.forEach((material, number) => {
    // Metal that emits has no second entry of the material table
    const faces =
      material.base && !(material.kind === "mirror" && material.emission.some(Boolean)) ? facesOf(mesh, number) : [];
    if (!faces.length) return;
    const { isPlain, colours: found } = library.swatches(
      mesh.textures[material.base.texture],
      valuesOf(mesh.uvs, faces, 6),
    );
    const own = isPlain.includes(1)
      ? materials.push({ ...material, base: null, albedo: [1, 1, 1], ofTexture: material }) - 1
      : -1;
    faces.forEach((face, i) => {
      if (!isPlain[i]) return;
      hasSwatches = true;
      materialOf[face] = own;
      for (let at = 0; at < 9; ++at) colours[9 * face + at] = found[9 * i + at] * material.albedo[at % 3];
    });
  });
  return hasSwatches ? { ...mesh, materials, materialOf, colours } : mesh;
}
