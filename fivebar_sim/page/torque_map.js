// The map of torques: the larger of the two motors' for the force, at every point in reach.
//
// It is computed a few thousand points a frame, coarse first, so that a frame's work is bounded
// however fast the force or a slider moves.

import { MAP_SIDE } from "./leg.js";

/** Points that are computed in one frame at most. */
export const POINTS_A_FRAME = 8192;

/** Points to a side, from coarse to fine. */
const LEVELS = [64, 128, MAP_SIDE];

/** Bands of colour from no torque to the end of the scale. */
const BANDS = 14;

/** The scale ends at this many times the middle torque: at the edge torques grow without end. */
const SPREAD = 2.2;

export class TorqueMap {
  constructor(leg) {
    this.leg = leg;
    this.canvas = document.createElement("canvas");
    this.key = "";
    this.top = 0;
    this.done = true;
    this.points = 0;
  }

  /** Start again if the leg, the force, the window or the colours have changed. */
  show(state, view, colours) {
    const box = [view.point([0, view.height]), view.point([view.width, 0])];
    const key = [state.version, ...box.flat(), colours.key].join();
    if (key === this.key) return;
    this.key = key;
    this.box = box;
    this.colours = colours;
    this.exact = state.lengths[5] === 0;
    this.level = 0;
    this.next = 0;
    this.done = false;
    this.image = null;
  }

  /** Compute the next points; return whether the picture has changed. */
  work(force) {
    this.points = 0;
    if (this.done) return false;
    const grid = this.#grid(LEVELS[this.level]);
    const all = grid.columns * grid.rows;
    const count = Math.min(POINTS_A_FRAME, all - this.next);
    this.leg.survey(grid, force, this.next, count);
    this.points = count;
    this.next += count;
    if (this.next < all) return false;

    if (this.level === 0) this.top = scaleTop(this.leg.map, all, this.top);
    this.#paint(grid, this.exact);
    this.next = 0;
    this.level += 1;
    this.done = this.level === LEVELS.length;
    return true;
  }

  #grid(side) {
    const [low, high] = this.box;
    const width = high[0] - low[0];
    const height = high[1] - low[1];
    const step = Math.max(width, height) / (side - 1);
    return {
      x: low[0],
      z: low[1],
      step,
      columns: Math.min(side, Math.ceil(width / step) + 1),
      rows: Math.min(side, Math.ceil(height / step) + 1),
    };
  }

  #paint(grid, exact) {
    const { columns, rows } = grid;
    this.canvas.width = columns;
    this.canvas.height = rows;
    const context = this.canvas.getContext("2d");
    const image = context.createImageData(columns, rows);
    const pixels = new Uint32Array(image.data.buffer);
    const bands = this.colours.bands;
    const values = this.leg.map;
    for (let row = 0; row < rows; row++) {
      // The picture's first row is the highest.
      const from = (rows - 1 - row) * columns;
      for (let column = 0; column < columns; column++) {
        let value = values[from + column];
        // With an exact edge over it the picture may reach a point farther than the leg.
        if (value < 0 && exact) value = neighbour(values, from + column, columns);
        if (!(value >= 0)) continue;
        const band = Math.min(Math.floor((value / this.top) * BANDS), BANDS - 1);
        pixels[row * columns + column] = bands[band];
      }
    }
    context.putImageData(image, 0, 0);
    this.grid = grid;
  }

  /** Draw the picture where its points lie. */
  draw(context, view) {
    if (!this.grid) return;
    const { x, z, step, columns, rows } = this.grid;
    const [left, top] = view.pixel([x - step / 2, z + (rows - 0.5) * step]);
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = "low";
    const size = step * view.scale;
    context.drawImage(this.canvas, left, top, columns * size, rows * size);
  }
}

/** Return the value of a point beside one out of reach, -1 if none is in reach. */
function neighbour(values, at, columns) {
  for (const step of [1, -1, columns, -columns, columns + 1, columns - 1, 1 - columns, -1 - columns]) {
    if (values[at + step] >= 0) return values[at + step];
  }
  return -1;
}

/** Return a round end for the scale of some torques; the old one if it still does. */
function scaleTop(values, count, old) {
  const reached = values.slice(0, count).filter((value) => value >= 0 && value < Infinity);
  if (reached.length === 0) return old || 1;
  reached.sort();
  const wanted = Math.max(SPREAD * reached[reached.length >> 1], 1e-6);
  // Otherwise the colours would flicker while a force is pulled.
  if (wanted > 0.5 * old && wanted < old) return old;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return power * [1, 1.5, 2, 3, 5, 7, 10].find((step) => step * power >= wanted);
}

/** Return the colours of the bands between two or more "#rrggbb", as pixels. */
export function bandsOf(stops) {
  const rgb = stops.map((stop) => [1, 3, 5].map((k) => parseInt(stop.slice(k, k + 2), 16)));
  return Array.from({ length: BANDS }, (_, band) => {
    const at = (band / (BANDS - 1)) * (rgb.length - 1);
    const k = Math.min(Math.floor(at), rgb.length - 2);
    const [r, g, b] = rgb[k].map((part, i) => Math.round(part + (rgb[k + 1][i] - part) * (at - k)));
    return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
  });
}
