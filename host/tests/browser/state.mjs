// Reads links as the page does: node state.mjs FOLDER, which has job.json, a list of them. It writes the states that
// differ from the defaults, in result.json.

import { readFileSync, writeFileSync } from "node:fs";
import { DEFAULTS, readState } from "../../../site/state.js";

const folder = process.argv[2];
const changed = (state) =>
  Object.fromEntries(Object.entries(state).filter(([name, value]) => value !== DEFAULTS[name]));
const links = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
writeFileSync(`${folder}/result.json`, JSON.stringify(links.map((link) => changed(readState(link)))));
