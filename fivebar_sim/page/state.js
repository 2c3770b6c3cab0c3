// What is on the page: the leg, where its foot is, the force on it; and how that may change.

import { OK } from "./leg.js";
import { add, apart, between, cross, length, polar, sub } from "./plane.js";

/** Halvings of the way to a point out of reach: the foot ends within 1/1000 of it at the edge. */
const HALVINGS = 12;

/** Points to a side of the grid in which a reachable one is looked for. */
const SEARCH = 64;

export class State {
  /** @param start lengths [m], bend, tilt [rad], signs, foot [m], force [N], as the page was given. */
  constructor(leg, start) {
    this.leg = leg;
    this.start = start;
    this.reset();
  }

  reset() {
    this.lengths = [...this.start.lengths];
    this.signs = [...this.start.signs];
    this.foot = [...this.start.foot];
    this.force = [...this.start.force];
    this.target = [...this.foot];
    this.refused = this.leg.prepare(this.lengths, this.signs);
    this.version = (this.version ?? 0) + 1;
    this.moveTo(this.foot);
  }

  get size() {
    const [L1, L2, L3, L4, , L6] = this.lengths;
    return Math.max(L1 + L2 + L6, L4 + L3);
  }

  /** The motor axes. */
  get bases() {
    const half = polar(this.lengths[4] / 2, this.lengths[7]);
    return { A: [-half[0], -half[1]], E: half };
  }

  /** |BF|, which side A spans together with L1. */
  get far() {
    return length(add([this.lengths[1], 0], polar(this.lengths[5], this.lengths[6])));
  }

  /** Put the foot at a point, or as near to it as the leg gets. */
  moveTo(target) {
    this.target = [...target];
    if (!this.leg.reaches(target)) {
      this.foot = this.#nearestTo(target);
    } else {
      this.foot = [...target];
    }
    this.pose = this.leg.inverse(this.foot, this.force);
    return this.pose.status;
  }

  #nearestTo(target) {
    const nearest = this.leg.nearest(target);
    if (nearest !== null && this.leg.reaches(nearest)) return nearest;

    // With an extension that point may be another working mode's: from one in reach as far towards
    // the target as there is reach.
    let inside = this.leg.reaches(this.foot) ? this.foot : this.#anywhere(target);
    let outside = target;
    for (let k = 0; k < HALVINGS; k++) {
      const middle = between(inside, outside, 0.5);
      if (this.leg.reaches(middle)) inside = middle;
      else outside = middle;
    }
    return inside;
  }

  /** Return the point of a grid that is in reach and nearest to a point. */
  #anywhere(target) {
    const reached = this.#grid();
    const nearer = (best, point) => (apart(point, target) < apart(best, target) ? point : best);
    return reached.length > 0 ? reached.reduce(nearer) : target;
  }

  /** Return the corners of a box about all that the leg reaches, its motors included. */
  reached() {
    const points = [...this.#grid(), this.bases.A, this.bases.E];
    const ends = (k) => [Math.min(...points.map((p) => p[k])), Math.max(...points.map((p) => p[k]))];
    const [left, right] = ends(0);
    const [bottom, top] = ends(1);
    return [
      [left, bottom],
      [right, top],
    ];
  }

  /** Return the points of a grid that are in reach. */
  #grid() {
    const reach = this.size + this.lengths[4];
    const points = [];
    for (let k = 0; k < SEARCH * SEARCH; k++) {
      const x = (((k % SEARCH) + 0.5) / SEARCH) * 2 - 1;
      const z = ((Math.floor(k / SEARCH) + 0.5) / SEARCH) * 2 - 1;
      const point = [reach * x, reach * z];
      if (this.leg.reaches(point)) points.push(point);
    }
    return points;
  }

  /** Turn one motor (0: A, 1: E) to an angle, the other one held; return the firmware's status. */
  turn(motor, angle) {
    const theta = [...this.pose.theta];
    theta[motor] = angle;
    const pose = this.leg.forward(theta, this.pose.assembly, this.force);
    if (pose.status !== OK) return pose.status;
    this.#take(pose);
    return OK;
  }

  /** Close the loop on the other side of BD. */
  flip() {
    const pose = this.leg.forward(this.pose.theta, -this.pose.assembly, this.force);
    if (pose.status === OK) this.#take(pose);
    return pose.status;
  }

  #take(pose) {
    const { A, E } = this.bases;
    const side = (motor, end, knee) => (cross(sub(end, motor), sub(knee, motor)) < 0 ? -1 : 1);
    this.setSigns([side(A, pose.F, pose.B), side(E, pose.C, pose.D)]);
    this.foot = pose.F;
    this.target = pose.F;
    this.pose = pose;
  }

  setSigns(signs) {
    if (signs[0] === this.signs[0] && signs[1] === this.signs[1]) return;
    this.signs = signs;
    this.version += 1;
    this.leg.prepare(this.lengths, signs);
  }

  setMode(signs) {
    this.setSigns(signs);
    this.moveTo(this.target);
  }

  setForce(force) {
    this.force = force;
    this.version += 1;
    this.pose = this.leg.inverse(this.foot, force);
  }

  /** Change one of L1..L6, bend, tilt; lengths that make no leg are refused, and nothing changes. */
  setLength(index, value) {
    const lengths = [...this.lengths];
    lengths[index] = value;
    const status = this.leg.prepare(lengths, this.signs);
    this.refused = status;
    if (status === OK) {
      this.lengths = lengths;
      this.version += 1;
    } else {
      this.leg.prepare(this.lengths, this.signs);
    }
    this.moveTo(this.target);
    return status;
  }

  /** How far the poses are from the three kinds of singularity [m]; see `analysis.singularity`. */
  get distances() {
    const { A, E } = this.bases;
    const { B, C, D, F } = this.pose;
    const [L1, L2, L3, L4] = this.lengths;
    return {
      A: Math.abs(cross(sub(F, A), sub(B, A))) / Math.max(L1, this.far),
      E: Math.abs(cross(sub(C, E), sub(D, E))) / Math.max(L4, L3),
      loop: Math.abs(cross(sub(D, B), sub(C, B))) / Math.max(L2, L3),
    };
  }

  get isOut() {
    return this.leg.reaches(this.target) === false;
  }
}

