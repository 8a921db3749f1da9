// The corners of a mesh that is being read.

/** The tab reads so many triangles; the command line reads more. */
const MOST_TRIANGLES = 4_000_000;

/** Collects polygons as fans of triangles. */
export class Corners {
  constructor() {
    this.faces = [];
    this.normals = [];
    this.colours = [];
    this.materials = [];
    this.uvs = [];
    this.metalUvs = [];
    this.hasNormals = false;
    this.hasColours = false;
    this.notes = new Set();
  }

  /** `material`: a number; `uvs`, `metalUvs`: positions in its textures; null for none, as of normals and colours. */
  add(vertices, normals, colours, material = 0, uvs = null, metalUvs = null) {
    for (let i = 1; i + 1 < vertices.length; ++i) {
      this.materials.push(material);
      for (const corner of [0, i, i + 1]) {
        this.faces.push(vertices[corner]);
        this.normals.push(...(normals?.[corner] ?? [0, 0, 0]));
        this.colours.push(...(colours?.[corner] ?? [1, 1, 1]));
        this.uvs.push(...(uvs?.[corner] ?? [0, 0]));
        this.metalUvs.push(...(metalUvs?.[corner] ?? [0, 0]));
      }
    }
    if (this.faces.length > 3 * MOST_TRIANGLES) throw new Error(`the mesh has more than ${MOST_TRIANGLES.toLocaleString("en")} triangles: the command line reads larger ones`);
    this.hasNormals ||= Boolean(normals?.some(Boolean));
    this.hasColours ||= Boolean(colours?.some(Boolean));
  }

  mesh(vertices) {
    return {
      vertices: Float64Array.from(vertices),
      faces: Int32Array.from(this.faces),
      normals: this.hasNormals ? Float64Array.from(this.normals) : null,
      colours: this.hasColours ? Float64Array.from(this.colours) : null,
      materialOf: Int32Array.from(this.materials),
      uvs: Float64Array.from(this.uvs),
      metalUvs: Float64Array.from(this.metalUvs),
      notes: [...this.notes],
    };
  }
}
