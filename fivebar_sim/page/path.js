// A foot path drawn by hand: smoothed, at equal steps, played, and what it asks of the motors.

import { OK } from "./leg.js";
import { apart, between } from "./plane.js";

/** Setpoints of a path. */
export const ROWS = 120;

/** Passes of a three-point mean: a hand trembles, and at a corner no motor could follow. */
const PASSES = 20;

export class Path {
  constructor() {
    this.made = 0;
    this.clear();
  }

  clear() {
    this.drawn = [];
    this.points = [];
    this.rows = [];
    this.key = "";
    this.phase = 0;
    this.playing = false;
  }

  get exists() {
    return this.points.length > 0;
  }

  /** Begin, go on and end a path under the pointer. */
  begin(point) {
    this.clear();
    this.drawn = [point];
  }

  extend(point, least) {
    if (apart(point, this.drawn.at(-1)) >= least) this.drawn.push(point);
  }

  /** Close what was drawn to a loop; return whether it is a path at all. */
  end(least) {
    const long = this.drawn.reduce((sum, p, k, all) => sum + (k ? apart(p, all[k - 1]) : 0), 0);
    if (this.drawn.length < 4 || long < 4 * least) {
      this.clear();
      return false;
    }
    this.set(rounded([...this.drawn, this.drawn[0]]));
    return true;
  }

  set(points) {
    this.drawn = [];
    this.points = points;
    this.made += 1;
    this.key = "";
    this.phase = 0;
  }

  /** Evaluate every setpoint; only if the path, the leg or the force has changed. */
  measure(state) {
    if (!this.exists || this.key === state.version) return 0;
    this.key = state.version;
    this.rows = this.points.map((point) => {
      const pose = state.leg.inverse(point, state.force);
      return { theta: pose.theta, tau: pose.tau, ok: pose.status === OK };
    });
    unwrap(this.rows);
    return this.points.length;
  }

  /** The foot at a phase of the loop, 0 to 1. */
  at(phase) {
    const place = (phase - Math.floor(phase)) * this.points.length;
    const k = Math.floor(place);
    return between(this.points[k], this.points[(k + 1) % this.points.length], place - k);
  }
}

/** Return `ROWS` points at equal distances along a line that ends where it begins. */
function resampled(points) {
  const far = [0];
  for (let k = 1; k < points.length; k++) far.push(far[k - 1] + apart(points[k], points[k - 1]));
  const found = [];
  let k = 1;
  for (let row = 0; row < ROWS; row++) {
    const wanted = (far.at(-1) * row) / ROWS;
    while (far[k] < wanted) k += 1;
    const span = far[k] - far[k - 1];
    found.push(between(points[k - 1], points[k], span > 0 ? (wanted - far[k - 1]) / span : 0));
  }
  return found;
}

/** Return `ROWS` points of a closed line whose corners are rounded. */
function rounded(line) {
  let points = resampled(line);
  for (let pass = 0; pass < PASSES; pass++) points = smoothed(points);
  return resampled([...points, points[0]]);
}

function smoothed(points) {
  const n = points.length;
  return points.map((point, k) => {
    const before = points[(k + n - 1) % n];
    const after = points[(k + 1) % n];
    return [0, 1].map((i) => 0.25 * before[i] + 0.5 * point[i] + 0.25 * after[i]);
  });
}

/** Make the angles go on where they would jump by a turn. */
function unwrap(rows) {
  let last = null;
  for (const row of rows.filter((each) => each.ok)) {
    if (last !== null) {
      row.theta = row.theta.map((angle, side) => {
        return angle - 2 * Math.PI * Math.round((angle - last[side]) / (2 * Math.PI));
      });
    }
    last = row.theta;
  }
}

/** Return a stride about a place: a flat stance, and back through the air in half an ellipse. */
export function stride(middle, long, high) {
  const points = [];
  for (let k = 0; k <= 60; k++) points.push([middle[0] + (0.5 - k / 60) * long, middle[1]]);
  for (let k = 1; k <= 60; k++) {
    const angle = Math.PI * (1 - k / 60);
    const across = 0.5 * long * Math.cos(angle);
    points.push([middle[0] + across, middle[1] + high * Math.sin(angle)]);
  }
  return rounded(points);
}
