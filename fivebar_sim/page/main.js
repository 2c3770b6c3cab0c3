// The page: one state, one picture, drawn when something has changed.

import { Charts } from "./chart.js";
import * as construction from "./construction.js";
import * as draw from "./draw.js";
import { Leg, OK, STATUS } from "./leg.js";
import { Panel, torque } from "./panel.js";
import { Path, stride } from "./path.js";
import { View, apart } from "./plane.js";
import { Hands } from "./pointer.js";
import { State } from "./state.js";
import { PERIOD, header, scenario } from "./text.js";
import { TorqueMap, bandsOf } from "./torque_map.js";

const at = (id) => document.getElementById(id);
const chosen = (name) => document.querySelector(`input[name="${name}"]:checked`).value;

class Page {
  constructor(leg, start) {
    this.start = start;
    this.largest = start.largest;
    this.state = new State(leg, start);
    this.view = new View();
    this.map = new TorqueMap(leg);
    this.path = new Path();
    this.charts = new Charts(at("chart"));
    this.words = "";
    this.dirty = true;
    this.last = 0;
    /** What frames have cost: for tests and measurements. */
    this.stats = { frames: 0, points: 0, mostPoints: 0, busy: 0, longest: 0 };
    this.panel = new Panel(this.state, (words) => this.changed(words));
    this.hands = new Hands(this, document.querySelector(".view"));
    this.canvas = at("view");
    // Without transparency a copy of the background takes a twentieth of the time.
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.background = document.createElement("canvas");
    this.behind = this.background.getContext("2d", { alpha: false });
    this.readColours();
    this.#listen();
    requestAnimationFrame((now) => this.frame(now));
  }

  get tool() {
    return chosen("tool");
  }

  /** The shortest step of a path drawn by hand [m]. */
  get leastStep() {
    return 4 / this.view.scale;
  }

  /** Have the picture drawn anew; words say what is wrong. */
  changed(words) {
    this.words = words;
    this.dirty = true;
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    const names = ["paper", "ink", "muted", "grid", "wash", "A", "E", "foot", "force", "singular", "target"];
    const colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    const stops = ["low", "mid", "high"].map((name) => style.getPropertyValue(`--${name}`).trim());
    colours.edge = colours.muted;
    colours.font = "system-ui, sans-serif";
    colours.bands = bandsOf(stops);
    colours.key = stops.join() + colours.paper;
    this.colours = colours;
    at("bands").style.background = `linear-gradient(90deg, ${stops.join()})`;
    this.dirty = true;
  }

  #listen() {
    const redraw = () => this.changed("");
    for (const input of document.querySelectorAll(".toolbar input")) {
      input.addEventListener("change", () => {
        document.querySelector(".view").classList.toggle("draws", this.tool === "draw");
        this.frameKey = "";
        redraw();
      });
    }
    at("reset").addEventListener("click", () => {
      this.state.reset();
      this.path.clear();
      redraw();
    });
    at("theme").addEventListener("click", () => {
      const dark = matchMedia("(prefers-color-scheme: dark)").matches;
      const root = document.documentElement;
      const now = root.dataset.theme ?? (dark ? "dark" : "light");
      root.dataset.theme = now === "dark" ? "light" : "dark";
      this.readColours();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.readColours());
    new ResizeObserver(redraw).observe(document.querySelector(".view"));

    at("stride").addEventListener("click", () => this.#stride());
    at("play").addEventListener("click", () => {
      this.path.playing = !this.path.playing;
      redraw();
    });
    at("clear").addEventListener("click", () => {
      this.path.clear();
      redraw();
    });
    at("copy-scenario").addEventListener("click", () =>
      this.#give("scenario.toml", scenario(this.state, this.path, this.start)),
    );
    at("copy-header").addEventListener("click", () => {
      this.path.measure(this.state);
      this.#give("page_leg.h", header(this.state, this.path, this.start));
    });
  }

  #stride() {
    const { state } = this;
    let long = 0.5 * state.size;
    const fits = (points) => points.every((point) => state.leg.reaches(point));
    let points = stride(state.foot, long, 0.4 * long);
    while (long > 0.02 * state.size && !fits(points)) {
      long *= 0.85;
      points = stride(state.foot, long, 0.4 * long);
    }
    this.path.set(points);
    this.pathMade();
  }

  pathMade() {
    this.path.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    document.querySelector('input[name="tool"][value="move"]').checked = true;
    document.querySelector(".view").classList.remove("draws");
    this.changed("");
  }

  async #give(title, text) {
    at("given-title").textContent = title;
    at("given-text").value = text;
    at("given").showModal();
    at("given-text").select();
    at("given-text").scrollTop = 0;
    try {
      await navigator.clipboard.writeText(text);
      at("given-said").textContent = "Copied to the clipboard.";
    } catch {
      at("given-said").textContent = "Selected: copy it with Ctrl-C.";
    }
  }

  frame(now) {
    requestAnimationFrame((next) => this.frame(next));
    this.step(now);
  }

  /** Do the work of one frame. */
  step(now) {
    const began = performance.now();
    const seconds = Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    if (this.path.playing) {
      this.path.phase = (this.path.phase + seconds / PERIOD) % 1;
      this.state.moveTo(this.path.at(this.path.phase));
      this.dirty = true;
    }
    // A page that is not laid out yet has nothing to draw on.
    if (!this.#fit()) return;
    const mapped = at("show-map").checked && this.#survey();
    if (!this.dirty && !mapped) return;
    this.dirty = false;
    this.#draw();

    const spent = performance.now() - began;
    this.stats.frames += 1;
    this.stats.busy += spent;
    this.stats.longest = Math.max(this.stats.longest, spent);
  }

  /** Fit the window to the leg and the page; return whether there is room to draw. */
  #fit() {
    const box = this.canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    const all = at("show-all").checked;
    const key = [box.width, box.height, ratio, all, ...this.state.start.lengths].join();
    if (box.width < 1 || box.height < 1) return false;
    if (key === this.frameKey) return true;
    this.frameKey = key;
    // A canvas that gets a size is empty.
    this.backgroundKey = "";
    for (const canvas of [this.canvas, this.background]) {
      canvas.width = Math.round(box.width * ratio);
      canvas.height = Math.round(box.height * ratio);
    }
    this.view.fit(box.width, box.height, ...this.#window(all), 24);
    return true;
  }

  /** Return the corners of what is shown: all that the leg reaches, or what is on the foot's side. */
  #window(all) {
    const [low, high] = this.state.reached();
    const aside = 0.42 * this.state.size;
    if (all) return [low, high];
    return this.start.foot[1] < 0
      ? [low, [high[0], Math.min(high[1], aside)]]
      : [[low[0], Math.max(low[1], -aside)], high];
  }

  /** Go on with the map of torques; return whether its picture has changed. */
  #survey() {
    this.map.show(this.state, this.view, this.colours);
    const changed = this.map.work(this.state.force);
    this.stats.points += this.map.points;
    this.stats.mostPoints = Math.max(this.stats.mostPoints, this.map.points);
    if (changed) this.backgroundKey = "";
    return changed;
  }

  /** Draw what stays while only the foot moves onto a canvas of its own. */
  #drawBackground() {
    const mapped = at("show-map").checked;
    const key = [this.map.key, this.state.version, mapped, this.frameKey, this.colours.key].join("|");
    if (key === this.backgroundKey) return;
    this.backgroundKey = key;
    const ratio = window.devicePixelRatio || 1;
    const context = this.behind;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.colours.paper;
    context.fillRect(0, 0, this.view.width, this.view.height);
    draw.workspace(context, this.view, this.colours, this.state, mapped ? this.map : null);
    draw.frame(context, this.view, this.colours);
  }

  #draw() {
    const { context, view, colours, state } = this;
    this.#drawBackground();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.background, 0, 0);
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);

    this.#drawPath();
    const which = chosen("construction");
    if (at("show-ellipse").checked) draw.ellipse(context, view, colours, state);
    draw.leg(context, view, colours, state);
    if (which !== "none") construction[which](context, view, colours, state);
    draw.target(context, view, colours, state);
    draw.force(context, view, colours, state, this.largest);
    this.#say();
    this.panel.show();
    this.panel.showFormulas(which);
    this.#placeHandles();
    this.#showPath();
  }

  #drawPath() {
    const { context, view, colours, path } = this;
    if (path.drawn.length > 1) draw.line(context, view, path.drawn, { colour: colours.target, width: 3 });
    if (!path.exists) return;
    draw.line(context, view, path.points, { colour: colours.paper, width: 5, close: true });
    draw.line(context, view, path.points, { colour: colours.target, width: 2.5, close: true });
    // What is out of reach is dotted over in the colour of what is wrong.
    for (const [k, row] of path.rows.entries()) {
      if (row.ok) continue;
      const ends = [path.points[k], path.points[(k + 1) % path.points.length]];
      draw.line(context, view, ends, { colour: colours.foot, width: 4 });
    }
  }

  /** Say what is wrong: the firmware's status, never an angle that it has not given. */
  #say() {
    const { state } = this;
    let words = this.words;
    const out = apart(state.target, state.foot);
    if (state.isOut) {
      words = `${STATUS[1]} by ${(1000 * out).toFixed(1)} mm: no angles; the leg stays at the edge`;
    } else if (state.pose.status !== OK) {
      words = STATUS[state.pose.status];
    }
    if (at("status").textContent !== words) at("status").textContent = words;
    at("legend").hidden = !at("show-map").checked;
    at("legend-top").textContent = torque(this.map.top);
  }

  #placeHandles() {
    const { state } = this;
    const mm = (p) => `${(p[0] * 1000).toFixed(1)}, ${(p[1] * 1000).toFixed(1)} mm`;
    const said = {
      foot: `Foot at ${mm(state.pose.F)}: arrow keys move it`,
      force: `Force of ${state.force[0].toFixed(1)}, ${state.force[1].toFixed(1)} N: arrow keys change it`,
      A: `Motor A at ${((state.pose.theta[0] * 180) / Math.PI).toFixed(1)} degrees: arrow keys turn it`,
      E: `Motor E at ${((state.pose.theta[1] * 180) / Math.PI).toFixed(1)} degrees: arrow keys turn it`,
    };
    for (const [name, place] of Object.entries(this.hands.places())) {
      const handle = at(`handle-${name}`);
      handle.style.transform = `translate(${place[0]}px, ${place[1]}px)`;
      handle.setAttribute("aria-label", said[name]);
    }
  }

  #showPath() {
    const { path } = this;
    path.measure(this.state);
    for (const id of ["play", "clear", "charts"]) at(id).hidden = !path.exists;
    at("play").textContent = path.playing ? "Pause" : "Play";
    const lost = path.rows.filter((row) => !row.ok).length;
    const share = Math.round((100 * lost) / Math.max(path.rows.length, 1));
    at("path-said").textContent = path.exists && lost > 0 ? `${share} % of it is out of reach` : "";
    if (path.exists) this.charts.show(this.colours, path);
  }
}

const leg = await Leg.fromBase64(at("wasm").textContent);
window.fivebar = new Page(leg, JSON.parse(at("start").textContent));
