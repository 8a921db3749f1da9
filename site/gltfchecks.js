// Checks the JSON of glTF files, as host/colonnade/mesh/files/gltf_checks.py and common/input_files.py do, with their
// words. Of materials only the factors are checked.

export const DRACO = "KHR_draco_mesh_compression";
export const INSTANCING = "EXT_mesh_gpu_instancing";
/** Extensions that a file may require. */
export const READ_EXTENSIONS = [
  "KHR_materials_transmission",
  "KHR_materials_ior",
  "KHR_materials_emissive_strength",
  "KHR_materials_pbrSpecularGlossiness",
  DRACO,
  "KHR_mesh_quantization",
  "KHR_lights_punctual",
  "KHR_materials_unlit",
  "KHR_texture_transform",
  "KHR_texture_basisu",
  INSTANCING,
  "EXT_texture_webp",
  "EXT_texture_avif",
];
const [MOST_ELEMENTS, MOST_LEVELS, MOST_DIGITS] = [100_000_000, 64, 40];

const LISTS = [
  "nodes",
  "meshes",
  "accessors",
  "bufferViews",
  "buffers",
  "materials",
  "scenes",
  "textures",
  "images",
  "samplers",
  "animations",
  "skins",
];
const words = (text) => new Set(text.split(" "));
/** Keys at any depth whose values are whole numbers from 0 on, texts, objects, and lists of these. */
const WHOLE = words(
  "mesh material bufferView buffer source sampler index texCoord byteOffset byteLength byteStride " +
    "componentType mode skin wrapS wrapT magFilter minFilter node input output inverseBindMatrices",
);
const TEXT = words("uri mimeType alphaMode");
const OBJECT = words(
  "attributes extensions pbrMetallicRoughness sparse values baseColorTexture metallicRoughnessTexture " +
    "normalTexture occlusionTexture emissiveTexture",
);
const [OBJECTS, WHOLES] = [words("primitives targets channels samplers"), words("nodes children joints")];

const isWhole = (value) => Number.isSafeInteger(value) && value >= 0;
const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
const isText = (value) => typeof value === "string";
const get = (object, key, otherwise) => (Object.hasOwn(object, key) ? object[key] : otherwise);

/** A text with its colon if it is a key, a bracket, or a number. */
const TOKENS = /("[^"\\]*(?:\\.[^"\\]*)*")(\s*:)?|[{}[\]]|-?\d[\d.eE+-]*/g;

/** The JSON of a document; `what` it is, for messages. */
export function parseDocument(bytes, what) {
  let text, json;
  try {
    text = new TextDecoder("utf-8", { fatal: true }).decode(bytes);
    json = JSON.parse(text);
  } catch (error) {
    throw new Error(`${what} is not JSON: ${text === undefined ? "it is not UTF-8 text" : error.message}`);
  }
  const levels = [];
  for (const [token, string, colon] of text.matchAll(TOKENS)) {
    if (colon) {
      const key = JSON.parse(string);
      if (levels.at(-1).has(key)) throw new Error(`${what} is not JSON: the key ${key} occurs twice in an object`);
      levels.at(-1).add(key);
    } else if (token === "{" || token === "[") {
      if (levels.length === MOST_LEVELS) throw new Error(`${what} is nested too deeply: ${MOST_LEVELS} levels at most`);
      levels.push(new Set());
    } else if (token === "}" || token === "]") levels.pop();
    else if (string === undefined && /^-?\d+$/.test(token)) {
      if (token.length > MOST_DIGITS)
        throw new Error(
          `${what} is not JSON: a number has ${token.length.toLocaleString("en")} digits, ${MOST_DIGITS} at most`,
        );
    } else if (string === undefined && !Number.isFinite(Number(token)))
      throw new Error(`${what} is not JSON: the number ${token} is too large`);
  }
  return json;
}

/** Refuses an object of a document with values of other types than glTF's. */
function checkTypes(value, where, fail) {
  if (Array.isArray(value)) value.forEach((entry, number) => checkTypes(entry, `${where}[${number}]`, fail));
  if (!isObject(value)) return;
  for (const [key, entry] of Object.entries(value)) {
    const entries = Array.isArray(entry) ? entry : [null];
    const need = (isValid, reason) => {
      if (!isValid) throw fail(`${where}.${key} ${reason}`);
    };
    need(!WHOLE.has(key) || isWhole(entry), "is not a whole number from 0 on");
    need(!TEXT.has(key) || isText(entry), "is not text");
    need(!OBJECT.has(key) || isObject(entry), "is not an object");
    need(key !== "extensions" || Object.values(entry).every(isObject), "has a value that is not an object");
    need(!OBJECTS.has(key) || entries.every(isObject), "is not a list of objects");
    need(!WHOLES.has(key) || entries.every(isWhole), "is not a list of whole numbers");
    need(key !== "attributes" || Object.values(entry).every(isWhole), "has a value that is not a whole number");
    const read =
      key === "extensions"
        ? Object.fromEntries(Object.entries(entry).filter(([name]) => READ_EXTENSIONS.includes(name)))
        : entry;
    if (key !== "extras") checkTypes(read, `${where}.${key}`, fail);
  }
}

/** Refuses a document with invalid accessors or factors, or whose nodes are not trees. */
export function checkDocument(document, name) {
  const fail = (reason) => new Error(`mesh ${name}: ${reason}: export it again`);
  if (!isObject(document)) throw fail("its JSON is not an object");
  const version = isObject(document.asset) ? document.asset.version : undefined;
  if (String(version).startsWith("1") || (version === undefined && isObject(document.nodes)))
    throw new Error(`mesh ${name}: it is glTF of version 1: export it as glTF 2.0`);
  for (const key of LISTS) {
    const entries = get(document, key, []);
    if (!Array.isArray(entries) || !entries.every(isObject)) throw fail(`${key} must be a list of objects`);
    checkTypes(entries, key, fail);
  }
  if (!isWhole(get(document, "scene", 0)) || !isObject(get(document, "extensions", {})))
    throw fail("its scene is not a whole number, or its extensions are not an object");
  const required = get(document, "extensionsRequired", []);
  if (!Array.isArray(required) || !required.every(isText)) throw fail("extensionsRequired is not a list of texts");
  const { accessors = [], materials = [], nodes = [] } = document;
  accessors.forEach((accessor, number) => {
    const sparse = get(accessor, "sparse", {
      count: 0,
      indices: { bufferView: 0, componentType: 5121 },
      values: { bufferView: 0 },
    });
    const parts = [sparse.indices, sparse.values];
    if (!parts.every(isObject) || !isText(get(accessor, "type", "")))
      throw fail(`accessor ${number} has an invalid type, or lacks indices or values`);
    if (!isWhole(sparse.count) || !parts.every((part) => "bufferView" in part))
      throw fail(`accessor ${number} lacks a part of its changes`);
    if (![5121, 5123, 5125].includes(sparse.indices.componentType))
      throw fail(`accessor ${number} has indices of an unknown type`);
  });
  accessors.forEach(({ count }, number) => {
    if (!isWhole(count) || count === 0 || count > MOST_ELEMENTS) throw fail(`accessor ${number} has an invalid count`);
  });
  materials.forEach((material, number) => {
    if (!factorsOf(material).every((value) => typeof value === "number" && value >= 0))
      throw fail(`material ${number} has a factor that is negative or not a number`);
  });
  checkNodes(nodes, fail);
}

/** What has to be a number from 0 on. */
function factorsOf(material) {
  const surface = get(material, "pbrMetallicRoughness", {});
  const lists = [get(surface, "baseColorFactor", []), get(material, "emissiveFactor", [])];
  const extensions = [
    ["transmission", "transmissionFactor"],
    ["ior", "ior"],
  ].map(([name, key]) => get(get(material, "extensions", {})[`KHR_materials_${name}`] ?? {}, key, 0));
  return [
    get(surface, "metallicFactor", 1),
    ...lists.flatMap((factors) => (Array.isArray(factors) ? factors : [null])),
    ...extensions,
  ];
}

/** Refuses nodes with two parents or in a cycle. */
function checkNodes(nodes, fail) {
  const parents = new Map();
  nodes.forEach(({ children = [] }, number) => {
    for (const child of children) {
      if (child >= nodes.length) throw fail(`node ${number} has a child that does not exist`);
      if (parents.has(child)) throw fail(`node ${child} has two parents`);
      parents.set(child, number);
    }
  });
  const isRooted = new Map();
  nodes.forEach((_, number) => {
    const path = [];
    let ancestor = number;
    while (parents.has(ancestor) && !isRooted.has(ancestor)) {
      path.push(ancestor);
      isRooted.set(ancestor, false);
      ancestor = parents.get(ancestor);
    }
    if (isRooted.get(ancestor) === false) throw fail(`node ${ancestor} is its own ancestor`);
    for (const each of path) isRooted.set(each, true);
  });
}
