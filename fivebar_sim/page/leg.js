// The firmware's leg: leg.wasm is firmware/fivebar_leg.c, and leg.c says where its numbers lie.

const LENGTHS = 0;
const SIGNS = 8;
const FOOT = 10;
const FORCE = 12;
const THETA = 14;
const JOINTS = 16;
const SLOPES = 24;
const TORQUE = 28;
const NEAREST = 30;
const SIDE = 32;
const COUNT = 33;

export const OK = 0;
export const UNREACHABLE = 1;
export const LOOP_OPEN = 2;
export const SINGULAR = 5;

/** What each status of the firmware means, as a sentence for people. */
export const STATUS = {
  [OK]: "",
  [UNREACHABLE]: "out of reach",
  [LOOP_OPEN]: "the loop is open: L2 and L3 do not meet, or B is on D",
  [SINGULAR]: "singular: B, C and D are in line, and no torque holds the foot",
  7: "these lengths make no leg",
};

/** The side of the largest map, in points. */
export const MAP_SIDE = 256;

export class Leg {
  constructor(exports) {
    this.exports = exports;
    const memory = exports.memory.buffer;
    this.numbers = new Float32Array(memory, exports.numbers(), COUNT);
    this.map = new Float32Array(memory, exports.map(), MAP_SIDE * MAP_SIDE);
  }

  static async fromBase64(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(bytes);
    return new Leg(instance.exports);
  }

  /** Take lengths [m], bend, tilt [rad] and the working mode; return the status. */
  prepare(lengths, signs) {
    this.numbers.set(lengths, LENGTHS);
    this.numbers.set(signs, SIGNS);
    return this.exports.prepare();
  }

  /** Return the pose that puts the foot somewhere [m], and what holds a force [N] there. */
  inverse(foot, force) {
    this.numbers.set(foot, FOOT);
    this.numbers.set(force, FORCE);
    return this.#pose(this.exports.inverse());
  }

  /** Return the pose of motor angles [rad] in an assembly mode. */
  forward(theta, assembly, force) {
    this.numbers.set(theta, THETA);
    this.numbers.set(force, FORCE);
    return this.#pose(this.exports.forward(assembly));
  }

  /** Return whether the foot reaches a point, whatever else may be wrong there. */
  reaches(foot) {
    this.numbers.set(foot, FOOT);
    return this.exports.inverse() !== UNREACHABLE;
  }

  /** Return the reachable point nearest to a point, or null where the firmware does not know. */
  nearest(foot) {
    this.numbers.set(foot, FOOT);
    return this.exports.nearest() === OK ? this.#pair(NEAREST) : null;
  }

  /** Fill `count` points of the map of torques from the `first` on; see leg.c. */
  survey(grid, force, first, count) {
    this.numbers.set(force, FORCE);
    this.exports.survey(grid.x, grid.z, grid.step, grid.columns, first, count);
  }

  #pair(at) {
    return [this.numbers[at], this.numbers[at + 1]];
  }

  #pose(status) {
    const J = this.#pair(SLOPES).concat(this.#pair(SLOPES + 2));
    return {
      status,
      theta: this.#pair(THETA),
      B: this.#pair(JOINTS),
      C: this.#pair(JOINTS + 2),
      D: this.#pair(JOINTS + 4),
      F: this.#pair(JOINTS + 6),
      J: status === OK ? J : null,
      tau: status === OK ? this.#pair(TORQUE) : null,
      assembly: this.numbers[SIDE],
    };
  }
}
