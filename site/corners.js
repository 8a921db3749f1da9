// The corners of a mesh that is being read.

/** The tab reads so many triangles; the command line reads more. */
const MOST_TRIANGLES = 4_000_000;

/** Refuses a mesh of too many triangles. */
export function checkTriangles(count) {
  if (count > MOST_TRIANGLES)
    throw new Error(
      `the mesh has more than ${MOST_TRIANGLES.toLocaleString("en")} triangles: the command line reads larger ones`,
    );
}

/** Collects the triangles of glTF primitives. */
export class Corners {
  constructor() {
    this.faces = [];
    this.normals = [];
    this.colours = [];
    this.materials = [];
    this.uvs = [];
    this.metalUvs = [];
    this.emissiveUvs = [];
    /** Of each face: the number of its normal map, positions in it and tangents of its corners; or null. */
    this.reliefs = [];
    this.alphas = [];
    this.hasOwnColours = [];
    this.hasNormals = false;
    this.hasColours = false;
    this.notes = new Set();
  }

  /**
   * `material`: a number; `uvs`, `metalUvs`, `emissiveUvs`: positions in its textures; null for none, as of normals and
   * colours, of `relief` and of `alphas`.
   */
  add(vertices, normals, colours, material, uvs, metalUvs, emissiveUvs, relief, alphas) {
    this.materials.push(material);
    this.reliefs.push(relief);
    this.hasOwnColours.push(Number(Boolean(colours)));
    this.faces.push(...vertices);
    for (const corner of [0, 1, 2]) {
      this.alphas.push(alphas?.[corner] ?? 1);
      this.normals.push(...(normals?.[corner] ?? [0, 0, 0]));
      this.colours.push(...(colours?.[corner] ?? [1, 1, 1]));
      this.uvs.push(...(uvs?.[corner] ?? [0, 0]));
      this.metalUvs.push(...(metalUvs?.[corner] ?? [0, 0]));
      this.emissiveUvs.push(...(emissiveUvs?.[corner] ?? [0, 0]));
    }
    checkTriangles(this.faces.length / 3);
    this.hasNormals ||= Boolean(normals);
    this.hasColours ||= Boolean(colours);
  }

  /** The numbers of the faces' normal maps, -1 for none, positions in them and tangents of three corners each. */
  relief() {
    const none = { map: -1, uvs: Array(3).fill([0, 0]), tangents: Array(3).fill([0, 0, 0, 0]) };
    const own = this.reliefs.map((relief) => relief ?? none);
    return {
      mapOf: Int32Array.from(own, ({ map }) => map),
      uvs: Float64Array.from(own.flatMap(({ uvs }) => uvs.flat())),
      tangents: Float64Array.from(own.flatMap(({ tangents }) => tangents.flat())),
    };
  }

  mesh(vertices) {
    return {
      vertices: Float64Array.from(vertices),
      faces: Int32Array.from(this.faces),
      normals: this.hasNormals ? Float64Array.from(this.normals) : null,
      colours: this.hasColours ? Float64Array.from(this.colours) : null,
      alphas: this.alphas.some((alpha) => alpha < 1) ? Float64Array.from(this.alphas) : null,
      hasOwnColours: Int32Array.from(this.hasOwnColours),
      materialOf: Int32Array.from(this.materials),
      uvs: Float64Array.from(this.uvs),
      metalUvs: Float64Array.from(this.metalUvs),
      emissiveUvs: Float64Array.from(this.emissiveUvs),
      relief: this.reliefs.some(Boolean) ? this.relief() : null,
      notes: [...this.notes],
    };
  }
}
