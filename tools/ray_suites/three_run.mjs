// Runs a test file of three-mesh-bvh, whose random numbers begin alike each time: node three_run.mjs FILE EVERY
// EVERY: of each group of tests the first one runs, and each EVERYth after it.
import { isDeepStrictEqual } from "node:util";
import { counts } from "three-mesh-bvh";

let seed = 12345n;
Math.random = () => {
  seed = (seed * 6364136223846793005n + 1442695040888963407n) & 0xffffffffffffffffn;
  return Number(seed >> 11n) / 2 ** 53;
};

const [file, every] = process.argv.slice(2);
const results = { passed: 0, failed: [] },
  names = [];
let before = [],
  tests = [];

globalThis.beforeAll = (call) => before.push(call);
globalThis.it = (name, call) => tests.push([name, call]);
globalThis.expect = (found) => ({
  toEqual(wanted) {
    if (!isDeepStrictEqual(found, wanted)) throw new Error("the values differ");
  },
});
globalThis.describe = (name, call) => {
  names.push(name);
  call();
  const [prepare, cases] = [before, tests];
  [before, tests] = [[], []];
  for (const each of prepare) each();
  for (const [test, run] of cases.filter((_, i) => i % Number(every) === 0)) {
    try {
      run();
      results.passed++;
    } catch (error) {
      results.failed.push(`${[...names, test].join(", ")}: ${error.message}`);
    }
  }
  names.pop();
};

await import(file);
console.log(JSON.stringify({ ...results, ...counts }));
