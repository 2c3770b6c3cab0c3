// The numbers and controls beside the picture.

import { OK, STATUS } from "./leg.js";
import { apart, direction, length, sub } from "./plane.js";

const DEGREES = 180 / Math.PI;
const MODES = [
  [-1, 1],
  [1, -1],
  [-1, -1],
  [1, 1],
];

/** The sliders: name, position among the lengths, and whether it is an angle. */
const SLIDERS = ["L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt"];

/** Shortest link that a slider gives, as a share of the leg's size. */
const SHORTEST = 0.05;

const minus = (text) => text.replace("-", "\u2212");
const fixed = (value, digits) => minus((Math.round(value * 10 ** digits) / 10 ** digits + 0).toFixed(digits));
const at = (id) => document.getElementById(id);

/** Write a text only where it changes: a page lays itself out anew for every change. */
function put(id, text) {
  const element = at(id);
  if (element.textContent !== text) element.textContent = text;
}

/** Return a torque with the unit that suits it. */
export function torque(value) {
  if (value === null || !Number.isFinite(value)) return "\u2014";
  const large = Math.abs(value) >= 1;
  return large ? `${fixed(value, 2)} N m` : `${fixed(value * 1000, Math.abs(value) < 0.1 ? 1 : 0)} mN m`;
}

export class Panel {
  constructor(state, changed) {
    this.state = state;
    this.changed = changed;
    this.#makeSliders();
    this.#makeModes();
    at("flip").addEventListener("click", () => {
      const status = state.flip();
      changed(status === OK ? "" : STATUS[status]);
    });
  }

  #makeSliders() {
    const { start } = this.state;
    const size = Math.max(...start.lengths.slice(0, 5));
    SLIDERS.forEach((name, index) => {
      const isAngle = index >= 6;
      const row = document.createElement("div");
      row.className = "slider";
      const unit = isAngle ? "deg" : "mm";
      const low = isAngle ? -180 : 1000 * size * (index >= 4 ? 0 : SHORTEST);
      const high = isAngle ? 180 : 1000 * size * (index >= 4 ? 1.25 : 2);
      const step = isAngle ? 1 : niceStep(high);
      row.innerHTML =
        `<label for="slide-${name}">${name}</label>` +
        `<input type="range" id="slide-${name}">` +
        `<span class="value"><input type="number" id="type-${name}" aria-label="${name} in ${unit}" step="any"><small>${unit}</small></span>`;
      at("sliders").append(row);
      const slide = at(`slide-${name}`);
      const type = at(`type-${name}`);
      Object.assign(slide, { min: String(Math.max(step, low) * (low > 0) || low), max: String(high), step: String(step) });
      const set = (value) => {
        if (!Number.isFinite(value)) return;
        const status = this.state.setLength(index, isAngle ? value / DEGREES : value / 1000);
        row.setAttribute("aria-invalid", String(status !== OK));
        put("refused", status === OK ? "" : `${name} = ${value} ${unit}: ${STATUS[status] ?? "not a leg"}`);
        this.changed("");
      };
      slide.addEventListener("input", () => set(Number(slide.value)));
      type.addEventListener("change", () => set(Number(type.value)));
    });
  }

  #makeModes() {
    const name = (sign) => (sign < 0 ? "\u2212" : "+");
    MODES.forEach((signs) => {
      const label = document.createElement("label");
      const text = `${name(signs[0])} ${name(signs[1])}`;
      label.innerHTML = `<input type="radio" name="mode" value="${signs.join()}" aria-label="${text}"><span>${icon(signs, this.state.start.foot[1] > 0)}${text}</span>`;
      label.firstChild.addEventListener("change", () => {
        this.state.setMode(signs);
        this.changed("");
      });
      at("modes").append(label);
    });
  }

  /** Show the present pose. */
  show() {
    const { state } = this;
    const { pose } = state;
    const solved = pose.status === OK;
    ["A", "E"].forEach((name, side) => {
      put(`theta-${name}`, `${fixed(pose.theta[side] * DEGREES, 1)}\u00b0`);
      put(`tau-${name}`, torque(solved ? pose.tau[side] : null));
      const knee = side === 0 ? pose.B : pose.D;
      put(`knee-${name}`, `${fixed(knee[0] * 1000, 1)}, ${fixed(knee[1] * 1000, 1)}`);
    });
    put("foot", `${fixed(pose.F[0] * 1000, 1)}, ${fixed(pose.F[1] * 1000, 1)} mm`);
    put("force", `${fixed(state.force[0], 1)}, ${fixed(state.force[1], 1)} N`);
    this.#showShare(solved ? pose.tau : null);
    this.#showDistances();
    this.#showModes();
    this.#showSliders();
  }

  #showShare(tau) {
    const whole = tau === null ? 0 : Math.abs(tau[0]) + Math.abs(tau[1]);
    const share = whole > 1e-9 ? Math.abs(tau[0]) / whole : null;
    at("share").parentElement.parentElement.classList.toggle("empty", share === null);
    at("share").style.width = `${(share ?? 0) * 100}%`;
    put("share-A", share === null ? "\u2014" : `${fixed(share * 100, 0)} %`);
    put("share-E", share === null ? "\u2014" : `${fixed((1 - share) * 100, 0)} %`);
  }

  #showDistances() {
    const { distances, lengths, far } = this.state;
    const [L1, L2, L3, L4] = lengths;
    put("side-A-name", `A, B, ${lengths[5] > 0 ? "F" : "C"} in line`);
    const most = { A: Math.min(L1, far), E: Math.min(L4, L3), loop: Math.min(L2, L3) };
    for (const key of ["A", "E", "loop"]) {
      const share = Math.min(distances[key] / most[key], 1);
      at(`far-${key}`).style.width = `${share * 100}%`;
      at(`far-${key}`).classList.toggle("near", share < 0.2);
      const digits = most[key] < 0.1 ? 1 : 0;
      put(`far-${key}-said`, `${fixed(distances[key] * 1000, digits)} mm`);
    }
  }

  #showModes() {
    const now = this.state.signs.join();
    for (const input of document.getElementsByName("mode")) input.checked = input.value === now;
    put("assembly", this.state.pose.assembly < 0 ? "\u22121" : "+1");
  }

  #showSliders() {
    SLIDERS.forEach((name, index) => {
      const value = this.state.lengths[index] * (index >= 6 ? DEGREES : 1000);
      const text = String(Number(value.toFixed(2)));
      if (document.activeElement !== at(`slide-${name}`)) at(`slide-${name}`).value = text;
      if (document.activeElement !== at(`type-${name}`)) at(`type-${name}`).value = text;
    });
  }

  /** Show the formulas of a construction with their numbers. */
  showFormulas(which) {
    at("formulas").hidden = which === "none";
    if (which === "inverse") at("formulas").innerHTML = inverseText(this.state);
    if (which === "forward") at("formulas").innerHTML = forwardText(this.state);
  }
}

function niceStep(high) {
  return high > 1000 ? 1 : high > 400 ? 0.5 : 0.1;
}

/** Return a small leg in a working mode, hanging or upright. */
function icon([s_A, s_E], upright) {
  // In a mirror at the ground the knees are on the other side of their lines.
  const mirror = upright ? -1 : 1;
  const left = s_A * mirror < 0 ? [3, 15] : [17, 17];
  const right = s_E * mirror > 0 ? [29, 15] : [15, 17];
  const y = (height) => (upright ? 34 - height : height);
  const path = (motor, knee) => `M${motor} ${y(8)}L${knee[0]} ${y(knee[1])}L16 ${y(28)}`;
  return (
    '<svg viewBox="0 0 32 32" fill="none" stroke-width="2.2" stroke-linecap="round" stroke-linejoin="round" aria-hidden="true">' +
    `<path stroke="var(--A)" d="${path(11, left)}"/><path stroke="var(--E)" d="${path(21, right)}"/></svg>`
  );
}

const mm = (value) => `${fixed(value * 1000, 1)} mm`;
const deg = (value) => `${fixed(value * DEGREES, 1)}\u00b0`;

function inverseText(state) {
  const { A, E } = state.bases;
  const { pose, lengths, signs } = state;
  const [L1, L2, L3, L4, , L6] = lengths;
  const rho = L6 > 0 ? "|BF|" : "L2";
  const side = (name, motor, end, near, far, words, s, theta) => {
    const d = apart(motor, end);
    const alpha = direction(sub(end, motor));
    const cosine = (near * near + d * d - far * far) / (2 * near * d);
    const beta = Math.acos(Math.max(-1, Math.min(1, cosine)));
    const sign = s < 0 ? "\u2212" : "+";
    return (
      `<h3 class="of-${name}">Side ${name}</h3><code>` +
      `d = |${words.end}| = ${mm(d)}\n` +
      `\u03b1 = direction of ${words.end} = ${deg(alpha)}\n` +
      `cos \u03b2 = (${words.near}\u00b2 + d\u00b2 \u2212 ${words.far}\u00b2) / 2 ${words.near} d\n` +
      `\u03b2 = ${deg(beta)}\n` +
      `\u03b8 = \u03b1 ${sign} \u03b2 = <b>${deg(theta)}</b></code>`
    );
  };
  return (
    "<h2>Inverse: from the foot to the angles</h2>" +
    "<p>Each side is a triangle of two links and the line d from its motor to its end. Its angle at the motor is \u03b2, by the law of cosines; the working mode says to which side it is added.</p>" +
    '<div class="sides"><div>' +
    side("A", A, pose.F, L1, state.far, { end: L6 > 0 ? "AF" : "AC", near: "L1", far: rho }, signs[0], pose.theta[0]) +
    "</div><div>" +
    side("E", E, pose.C, L4, L3, { end: "EC", near: "L4", far: "L3" }, signs[1], pose.theta[1]) +
    "</div></div>"
  );
}

function forwardText(state) {
  const { pose, lengths } = state;
  const [, L2, L3] = lengths;
  const BD = sub(pose.D, pose.B);
  const d = length(BD);
  const a = (d * d + (L2 - L3) * (L2 + L3)) / (2 * d);
  const h = Math.sqrt(Math.max(L2 * L2 - a * a, 0));
  const sign = pose.assembly < 0 ? "\u2212" : "+";
  return (
    "<h2>Forward: from the angles to the foot</h2>" +
    "<p>The motors place the knees B and D. C is where the circles about them cross, on the side that the assembly mode names.</p><code>" +
    `d = |BD| = ${mm(d)}\n\u03c6 = direction of BD = ${deg(direction(BD))}\n` +
    `a = (d\u00b2 + L2\u00b2 \u2212 L3\u00b2) / 2 d = ${mm(a)}\n` +
    `h = \u221a(L2\u00b2 \u2212 a\u00b2) = ${mm(h)}\n` +
    `C = B + a (cos \u03c6, sin \u03c6) ${sign} h (\u2212sin \u03c6, cos \u03c6)\n` +
    `  = <b>${fixed(pose.C[0] * 1000, 1)}, ${mm(pose.C[1])}</b>` +
    (lengths[5] > 0 ? "\nF = C + (L6 / L2) R(bend) BC" : "") +
    "</code>"
  );
}
