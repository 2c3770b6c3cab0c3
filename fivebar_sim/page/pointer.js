// Hands on the picture: a mouse, a finger or the keyboard move the foot, the force, a knee.

import { tip } from "./draw.js";
import { OK, STATUS } from "./leg.js";
import { apart, direction, length, scaled, sub } from "./plane.js";

/** How near [px] a pointer must come to something to hold it; a finger is thicker than a mouse. */
const NEAR = { mouse: 22, pen: 26, touch: 38 };

/** Step of an arrow key: share of the leg's size, share of the largest force, and radians. */
const KEY = { foot: 0.005, force: 0.02, motor: Math.PI / 180 };

/** With Shift a step is so much longer. */
const FAST = 10;

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Hands {
  /** @param page the page: state, view, path, largest force, tool, and `changed(words)`. */
  constructor(page, element) {
    this.page = page;
    this.element = element;
    this.held = null;
    element.addEventListener("pointerdown", (event) => this.#down(event));
    element.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      element.addEventListener(end, (event) => this.#up(event));
    }
    for (const name of ["foot", "force", "A", "E"]) {
      document.getElementById(`handle-${name}`).addEventListener("keydown", (event) => this.#key(name, event));
    }
  }

  /** Where everything that can be held is [px]. */
  places() {
    const { state, view, largest } = this.page;
    return {
      force: view.pixel(tip(state, largest)),
      foot: view.pixel(state.pose.F),
      A: view.pixel(state.pose.B),
      E: view.pixel(state.pose.D),
    };
  }

  #pixel(event) {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #under(pixel, kind) {
    const reach = NEAR[kind] ?? NEAR.mouse;
    let best = null;
    let least = reach;
    for (const [name, place] of Object.entries(this.places())) {
      const far = apart(place, pixel);
      if (far < least) {
        best = name;
        least = far;
      }
    }
    return best;
  }

  #down(event) {
    if (event.button !== 0 || this.held !== null) return;
    const pixel = this.#pixel(event);
    const point = this.page.view.point(pixel);
    if (this.page.tool === "draw") {
      this.page.path.begin(point);
      this.held = { name: "path", id: event.pointerId };
    } else {
      // A touch of the bare plane calls the foot there.
      const name = this.#under(pixel, event.pointerType) ?? "foot";
      this.held = { name, id: event.pointerId };
      this.page.path.playing = false;
      this.#drag(name, pixel);
    }
    this.element.setPointerCapture(event.pointerId);
    this.element.classList.add("holds");
    event.preventDefault();
    this.page.changed("");
  }

  #move(event) {
    const pixel = this.#pixel(event);
    if (this.held === null) {
      const over = this.page.tool === "move" && this.#under(pixel, event.pointerType) !== null;
      this.element.classList.toggle("grabs", over);
      return;
    }
    if (event.pointerId !== this.held.id) return;
    if (this.held.name === "path") {
      this.page.path.extend(this.page.view.point(pixel), this.page.leastStep);
      this.page.changed("");
    } else {
      this.#drag(this.held.name, pixel);
    }
  }

  #up(event) {
    if (this.held === null || event.pointerId !== this.held.id) return;
    if (this.held.name === "path" && this.page.path.end(this.page.leastStep)) this.page.pathMade();
    this.held = null;
    this.element.classList.remove("holds");
    this.page.changed("");
  }

  #drag(name, pixel) {
    const { state, view, largest } = this.page;
    const point = view.point(pixel);
    if (name === "foot") {
      state.moveTo(point);
      this.page.changed("");
    } else if (name === "force") {
      const k = largest / (0.55 * state.size);
      this.setForce(scaled(sub(point, state.pose.F), k));
    } else {
      this.turn(name, direction(sub(point, state.bases[name])));
    }
  }

  setForce(force) {
    const { state, largest } = this.page;
    const newtons = length(force);
    const most = 2 * largest;
    state.setForce(newtons > most ? scaled(force, most / newtons) : force);
    this.page.changed("");
  }

  turn(name, angle) {
    const status = this.page.state.turn(name === "A" ? 0 : 1, angle);
    this.page.changed(status === OK ? "" : STATUS[status]);
  }

  #key(name, event) {
    const way = ARROWS[event.key];
    if (way === undefined) return;
    event.preventDefault();
    const { state, largest, path } = this.page;
    const fast = event.shiftKey ? FAST : 1;
    path.playing = false;
    if (name === "foot") {
      const step = KEY.foot * state.size * fast;
      state.moveTo([state.foot[0] + way[0] * step, state.foot[1] + way[1] * step]);
      this.page.changed("");
    } else if (name === "force") {
      const step = KEY.force * largest * fast;
      this.setForce([state.force[0] + way[0] * step, state.force[1] + way[1] * step]);
    } else {
      // Up and right turn anticlockwise.
      const motor = name === "A" ? 0 : 1;
      this.turn(name, state.pose.theta[motor] + (way[0] + way[1]) * KEY.motor * fast);
    }
  }
}
