// Reads an animation of a glTF document as host/colonnade/mesh/files/gltf_clip.py does, with its errors: skins, morph
// targets and moving nodes, in the arrays of colonnade_clip (host/cpp/library/colonnade_model.h).

import { grouped } from "./gltfdocument.js";

const INFLUENCES = 4;
/** A path's place among those of colonnade_track, and its components; those of weights are the node's. */
const PATHS = new Map([
  ["translation", 3],
  ["rotation", 4],
  ["scale", 3],
  ["weights", 0],
]);
const INTERPOLATIONS = ["STEP", "LINEAR", "CUBICSPLINE"];
/** The matrix that moves nothing. */
export const EYE = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** The transpose of a matrix. */
const transposed = (matrix) => Array.from({ length: 16 }, (_, i) => matrix[4 * (i % 4) + (i >> 2)]);

export const animationNames = ({ animations = [] }) => animations.map(({ name }, number) => String(name ?? number));

/** Whether a channel moves a node or its morph targets. */
const isPlayed = ({ target }) => target?.node !== undefined && PATHS.has(target.path);

/** The number of the first animation of a document that moves something, or null. */
export function firstAnimation({ animations = [] }) {
  const number = animations.findIndex(({ channels = [] }) => channels.some(isPlayed));
  return number < 0 ? null : number;
}

export class ClipReader {
  document;
  notes;
  name;
  tracks;
  bones;
  inverses;
  influences;
  shares;
  targets;
  changes;
  count;

  /** `number` of the animation; `notes` take what it leaves out. */
  constructor(document, number, notes) {
    Object.assign(this, {
      document,
      notes,
      bones: new Map(),
      influences: [],
      shares: [],
      targets: new Map(),
      changes: [],
      count: 0,
    });
    this.name = animationNames(document.json)[number];
    this.tracks = this.readTracks(document.entry("animations", number));
  }

  error(reason) {
    return this.document.error(`its animation ${this.name} ${reason}: export it again`);
  }

  readTracks({ channels = [], samplers = [] }) {
    const tracks = [];
    for (const channel of channels) {
      if (!isPlayed(channel)) {
        this.notes.add("only channels of nodes and morph targets are played");
        continue;
      }
      const { sampler = -1, target } = channel;
      if (!samplers[sampler]) throw this.error(`uses sampler ${sampler}, which does not exist`);
      tracks.push(this.track(target.node, target.path, samplers[sampler]));
    }
    if (tracks.length === 0) throw this.error("moves no node and no morph target");
    if (new Set(tracks.map(({ node, path }) => `${node} ${path}`)).size < tracks.length)
      throw this.error("moves the same property of a node twice");
    return tracks;
  }

  track(index, path, { input, output, interpolation = "LINEAR" }) {
    const node = this.document.entry("nodes", index);
    if (!INTERPOLATIONS.includes(interpolation)) throw this.error("has an unknown interpolation");
    const keys = this.document.array(input);
    const times = keys.values.filter((_, i) => i % keys.width === 0);
    const { values } = this.document.array(output);
    if (!times.every(Number.isFinite) || !values.every(Number.isFinite))
      throw this.error("has a key that is not a finite number");
    if (times[0] < 0 || times.some((time, i) => i > 0 && !(time > times[i - 1])))
      throw this.error("has keys whose times do not ascend from 0 on");
    const width = path === "weights" ? this.targetsOf(node) : PATHS.get(path);
    if (path !== "weights" && node.matrix !== undefined) throw this.error(`moves node ${index}, which has a matrix`);
    if (values.length !== times.length * width * (interpolation === "CUBICSPLINE" ? 3 : 1))
      throw this.error(`has ${grouped(values.length)} numbers for ${grouped(times.length)} keys of a ${path}`);
    return {
      node: index,
      path: [...PATHS.keys()].indexOf(path),
      interpolation: INTERPOLATIONS.indexOf(interpolation),
      times,
      values,
    };
  }

  /** The number of a node's morph targets. */
  targetsOf({ mesh = -1 }) {
    return Math.max(
      0,
      ...(this.document.entry("meshes", mesh).primitives ?? []).map(({ targets = [] }) => targets.length),
    );
  }

  /** Takes the vertices of a primitive of a node, so many. */
  add(index, primitive, count) {
    const node = this.document.entry("nodes", index);
    if (node.skin === undefined || !this.addSkinned(node, primitive, count)) {
      const bone = this.bone(index, EYE);
      for (let vertex = 0; vertex < count; ++vertex) {
        this.influences.push(bone, bone, bone, bone);
        this.shares.push(1, 0, 0, 0);
      }
    }
    this.addTargets(index, node, primitive, count);
    this.count += count;
  }

  /** Adds bones and weights of the vertices of a skin; false if they have none. */
  addSkinned(node, primitive, count) {
    const { document } = this;
    const attributes = primitive.attributes ?? {};
    if (attributes.JOINTS_0 === undefined || attributes.WEIGHTS_0 === undefined) return false;
    const skin = document.entry("skins", node.skin);
    const { joints = [] } = skin;
    for (const joint of joints) document.entry("nodes", joint);
    const inverses = this.inversesOf(skin, joints.length);
    const sets = Array.from({ length: 8 }, (_, set) => set).filter(
      (set) => attributes[`JOINTS_${set}`] !== undefined && attributes[`WEIGHTS_${set}`] !== undefined,
    ).length;
    const parts = Array.from({ length: sets }, (_, set) => ({
      places: document.array(attributes[`JOINTS_${set}`]),
      weights: document.array(attributes[`WEIGHTS_${set}`]),
    }));
    const isValid = ({ places, weights }) =>
      places.isWhole &&
      [places, weights].every((part) => part.count === count && part.width === 4) &&
      weights.values.every((weight) => weight >= 0 && Number.isFinite(weight));
    if (!parts.every(isValid))
      throw document.error("a primitive has joints or weights that are not valid: export it again");
    const last = parts.reduce(
      (most, { places }) => places.values.reduce((largest, place) => Math.max(largest, place), most),
      0,
    );
    if (last >= joints.length)
      throw document.error(`a vertex has joint ${last}, its skin has ${joints.length}: export it again`);
    const bones = joints.map((joint, i) => this.bone(joint, inverses[i]));
    for (let vertex = 0; vertex < count; ++vertex) {
      const own = parts.flatMap(({ places, weights }) =>
        [0, 1, 2, 3].map((i) => ({
          bone: bones[places.values[4 * vertex + i]],
          weight: weights.values[4 * vertex + i],
        })),
      );
      own.sort((a, b) => b.weight - a.weight);
      if (own[INFLUENCES]?.weight > 0)
        this.notes.add("vertices with more than four joints are moved by the largest four");
      const kept = own.slice(0, INFLUENCES);
      if (kept[0].weight === 0) kept[0].weight = 1;
      const total = kept.reduce((sum, { weight }) => sum + weight, 0);
      this.influences.push(...kept.map(({ bone, weight }) => (weight > 0 ? bone : kept[0].bone)));
      this.shares.push(...kept.map(({ weight }) => weight / total));
    }
    return true;
  }

  inversesOf({ inverseBindMatrices }, count) {
    if (inverseBindMatrices === undefined) return Array(count).fill(EYE);
    const { width, values, count: own } = this.document.array(inverseBindMatrices);
    if (width !== 16 || own < count || !values.every(Number.isFinite))
      throw this.document.error("a skin has inverse bind matrices that are not valid: export it again");
    return Array.from({ length: count }, (_, i) => transposed(values.subarray(16 * i, 16 * (i + 1))));
  }

  /** The number of a joint with a matrix. */
  bone(joint, inverse) {
    const key = `${joint} ${inverse.join()}`;
    if (!this.bones.has(key)) this.bones.set(key, { joint, inverse, number: this.bones.size });
    return this.bones.get(key).number;
  }

  addTargets(index, node, { targets = [] }, count) {
    const weights = node.weights ?? this.document.entry("meshes", node.mesh).weights ?? [];
    targets.forEach((target, place) => {
      const weight = Array.isArray(weights) && place < weights.length ? weights[place] : 0;
      if (!Number.isFinite(weight))
        throw this.document.error(`a weight of node ${index} is not a finite number: export it again`);
      const key = `${index} ${place}`;
      this.targets.set(key, { number: this.targets.size, ...this.targets.get(key), node: index, place, weight });
      const { number } = this.targets.get(key);
      const [positions, normals] = ["POSITION", "NORMAL"].map((name) => this.added(target, name, count));
      for (let vertex = 0; vertex < count; ++vertex) {
        const [position, normal] = [positions, normals].map((values) => values.subarray(3 * vertex, 3 * vertex + 3));
        if ([...position, ...normal].some((value) => value !== 0))
          this.changes.push({ target: number, vertex: this.count + vertex, position, normal });
      }
    });
  }

  /** What a morph target adds to an attribute. */
  added(target, name, count) {
    if (target[name] === undefined) return new Float64Array(3 * count);
    const { count: own, width, values } = this.document.array(target[name]);
    if (own !== count || width !== 3 || !values.every(Number.isFinite))
      throw this.document.error(`a morph target has ${name} that are not valid: export it again`);
    return values;
  }

  /** The clip of vertices at these positions. */
  clip(positions) {
    // Bones that move no vertex are left out
    const used = [...new Set(this.influences)].sort((a, b) => a - b);
    const bones = [...this.bones.values()];
    const targets = [...this.targets.values()];
    const changes = this.changes.sort((a, b) => a.vertex - b.vertex);
    const [whole, real] = [(values) => Int32Array.from(values), (values) => Float64Array.from(values)];
    const places = new Map(used.map((bone, place) => [bone, place]));
    return {
      name: this.name,
      nodes: this.document.nodes(),
      tracks: this.tracks,
      bones: [whole(used.map((bone) => bones[bone].joint)), real(used.flatMap((bone) => bones[bone].inverse))],
      vertices: [positions, whole(this.influences.map((bone) => places.get(bone))), real(this.shares)],
      targets: [
        whole(targets.map(({ node }) => node)),
        whole(targets.map(({ place }) => place)),
        real(targets.map(({ weight }) => weight)),
      ],
      changes: [
        whole(changes.map(({ target }) => target)),
        whole(changes.map(({ vertex }) => vertex)),
        real(changes.flatMap(({ position }) => [...position])),
        real(changes.flatMap(({ normal }) => [...normal])),
      ],
    };
  }
}
