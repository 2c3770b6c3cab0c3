// What the page gives away as text: a scenario to simulate, a header for the firmware.

import { polar } from "./plane.js";

const KEYS = ["L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt"];
const UNITS = ["m", "m", "m", "m", "m", "m", "rad", "rad"];

/** Time of one loop of the path [s]. */
export const PERIOD = 1.5;

/** Ramp of a drawn path [s]; with it the path is half a ramp late. */
const RAMP = 0.25;

const number = (value) => {
  const text = String(Number(value.toPrecision(7)));
  return /[.e]/.test(text) ? text : `${text}.0`;
};
const pair = (p) => `[${p.map(number).join(", ")}]`;

/** Return a scenario in TOML: this leg along the drawn path, or a small ellipse about the foot. */
export function scenario(state, path, given) {
  const changed = KEYS.map((key, k) => [key, state.lengths[k], given.lengths[k], UNITS[k]]).filter(
    ([, now, before]) => given.preset === null || now !== before,
  );
  return [
    `# Written by fivebar page ${given.name}`,
    `duration = ${number(path.exists ? PERIOD + 0.45 * RAMP : 4 * PERIOD)} # [s]`,
    "",
    "[leg]",
    ...(given.preset === null ? given.rest : [`preset = "${given.preset}"`]),
    ...changed.map(([key, now, , unit]) => `${key} = ${number(now)} # [${unit}]`),
    `mode = [${state.signs.join(", ")}]`,
    `assembly = ${state.pose.assembly}`,
    "",
    "[path]",
    ...(path.exists ? lines(path) : ellipse(state)),
    "",
    "[scene]",
    'kind = "payload" # the hip held, and the force on the foot',
    "",
    "[force]",
    'kind = "constant"',
    `value = ${pair(state.force)} # [N], of the world on the foot`,
    "",
    "[controller]",
    'name = "servo"',
    'feedforward = "torque"',
    "",
  ].join("\n");
}

function lines(path) {
  const rows = [...path.points, path.points[0]];
  return [
    'kind = "lines"',
    `ramp = ${number(RAMP)} # [s], eased in from rest; the run ends just before the foot would stop`,
    `seconds = ${number(PERIOD / path.points.length)} # [s], each`,
    "points = [ # [m]",
    ...rows.map((point) => `    ${pair(point)},`),
    "]",
  ];
}

/** Return an ellipse about the foot, as large as the leg has room for. */
function ellipse(state) {
  let radius = 0.15 * state.size;
  const fits = () =>
    Array.from({ length: 24 }, (_, k) => polar(1, (k * Math.PI) / 12)).every(([c, s]) =>
      state.leg.reaches([state.foot[0] + 1.2 * radius * c, state.foot[1] + 0.6 * radius * s]),
    );
  while (radius > 1e-3 * state.size && !fits()) radius *= 0.7;
  return [
    'kind = "ellipse"',
    `centre = ${pair(state.foot)} # [m]`,
    `radii = ${pair([radius, 0.4 * radius])} # [m]`,
    `frequency = ${number(1 / PERIOD)} # [Hz]`,
  ];
}

const float = (value) => `${number(Math.fround(value))}f`;
const floats = (values) => `{${values.map(float).join(", ")}}`;

/** Return a C header: the leg's lengths for fivebar_prepare, and the path's setpoints. */
export function header(state, path, given) {
  const first = state.lengths.map((value, k) => `    .${KEYS[k]} = ${float(value)}, /* [${UNITS[k]}] */`);
  const rows = path.exists ? path.rows.filter((row) => row.ok) : [];
  const complete = rows.length > 0 && rows.length === path.rows.length;
  return [
    `/* Written by fivebar page ${given.name}: for firmware/fivebar_leg.h, in float. */`,
    "#ifndef FIVEBAR_PAGE_H",
    "#define FIVEBAR_PAGE_H",
    "",
    '#include "fivebar_leg.h"',
    "",
    "/* Call fivebar_prepare(&page_leg) once, and heed its status. */",
    "static fivebar_leg page_leg = {",
    ...first,
    `    .s_A = ${state.signs[0]},`,
    `    .s_E = ${state.signs[1]},`,
    `    .assembly = ${state.pose.assembly},`,
    "};",
    "",
    ...(complete ? table(rows) : ["/* No path was drawn that the leg can follow: no setpoints. */"]),
    "",
    "#endif",
    "",
  ].join("\n");
}

function table(rows) {
  return [
    "/* (theta_A, theta_E) [rad] at equal steps; the first row comes again after the last. */",
    `static const fivebar_real page_theta[${rows.length}][2] = {`,
    ...rows.map((row) => `    ${floats(row.theta)},`),
    "};",
    "static const fivebar_gait page_gait = {",
    "    .theta = page_theta,",
    `    .rows = ${rows.length},`,
    `    .rate = ${float(rows.length / PERIOD)}, /* [Hz] */`,
    "    .periodic = 1,",
    "};",
  ];
}

