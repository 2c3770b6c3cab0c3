// node bits.mjs MODULE.wasm FIRST COUNT BLOCK: what main.c prints, of the module's digest().
import { readFileSync } from "node:fs";

const [file, ...numbers] = process.argv.slice(2);
const [first, count, block] = numbers.map(Number);
const { instance } = await WebAssembly.instantiate(readFileSync(file), {});
for (let start = first; start < first + count; start += block) {
  const bits = BigInt.asUintN(64, instance.exports.digest(start, block));
  console.log(bits.toString(16).padStart(16, "0"));
}
