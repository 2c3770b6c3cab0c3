// The leg, its workspace, its velocity ellipse and the force, drawn on a canvas.

import { add, apart, between, direction, length, polar, scaled, sub } from "./plane.js";

/** Length of a force's arrow, as a share of the leg's size, per newton of the force's largest. */
export const ARROW = 0.55;

const LINK = 7;
const CASING = 12;
const JOINT = 6;
const MOTOR = 11;

/** Draw a line through points [m]. */
export function line(context, view, points, { colour, width, dash = [], close = false }) {
  context.beginPath();
  points.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...view.pixel(point)));
  if (close) context.closePath();
  context.setLineDash(dash);
  context.lineCap = dash.length ? "butt" : "round";
  context.lineJoin = "round";
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
  context.setLineDash([]);
}

/** Draw letters at a pixel, with a rim of paper that keeps them readable on anything; what comes after
 * "_" is an index. */
export function letters(context, colours, text, pixel, { colour, size = 14, bold = false }) {
  const [main, index = ""] = text.split("_");
  const font = (px) => `${bold ? "600 " : ""}${px}px ${colours.font}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = colours.paper;
  context.fillStyle = colour;
  context.font = font(size * 0.72);
  const more = index ? context.measureText(index).width + 1 : 0;
  context.font = font(size);
  const left = pixel[0] - (context.measureText(main).width + more) / 2;
  const right = left + context.measureText(main).width + 1;
  for (const put of ["strokeText", "fillText"]) {
    context.font = font(size);
    context[put](main, left, pixel[1]);
    context.font = font(size * 0.72);
    if (index) context[put](index, right, pixel[1] + size * 0.3);
  }
}

function circle(context, pixel, radius, fill, rim, width = 2) {
  context.beginPath();
  context.arc(...pixel, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.lineWidth = width;
  context.strokeStyle = rim;
  context.stroke();
}

/** Draw an arrow between two pixels. */
export function arrow(context, from, to, colour, width = 3) {
  const way = sub(to, from);
  const long = length(way);
  if (long < 2) return;
  const head = Math.min(12, long);
  const u = scaled(way, 1 / long);
  const neck = sub(to, scaled(u, head * 0.8));
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...neck);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineCap = "round";
  context.stroke();
  context.beginPath();
  context.moveTo(...to);
  context.lineTo(...add(sub(to, scaled(u, head)), [-u[1] * head * 0.5, u[0] * head * 0.5]));
  context.lineTo(...add(sub(to, scaled(u, head)), [u[1] * head * 0.5, -u[0] * head * 0.5]));
  context.closePath();
  context.fillStyle = colour;
  context.fill();
}

/** Limit what is drawn next to what a chain reaches: a ring about its motor. */
function clipToRing(context, view, motor, near, far) {
  const centre = view.pixel(motor);
  context.beginPath();
  context.arc(...centre, (near + far) * view.scale, 0, 2 * Math.PI);
  context.arc(...centre, Math.abs(near - far) * view.scale, 0, 2 * Math.PI, true);
  context.clip("evenodd");
}

/** Cover with paper what a chain does not reach. A clip would do as well, but in software it takes a
 * mask for every pixel. */
function coverOutside(context, view, colours, motor, near, far) {
  const centre = view.pixel(motor);
  context.fillStyle = colours.paper;
  context.beginPath();
  context.rect(0, 0, view.width, view.height);
  context.arc(...centre, (near + far) * view.scale, 0, 2 * Math.PI);
  context.fill("evenodd");
  context.beginPath();
  context.arc(...centre, Math.abs(near - far) * view.scale, 0, 2 * Math.PI);
  context.fill();
}

/** Draw the map of torques, with the exact edge of the workspace where it is made of circles. */
export function workspace(context, view, colours, state, map) {
  const { A, E } = state.bases;
  const [L1, L2, L3, L4, , L6] = state.lengths;
  const rings = [
    [A, L1, L2],
    [E, L4, L3],
  ];
  if (map) map.draw(context, view);
  if (L6 > 0) return;

  if (!map) {
    context.fillStyle = colours.wash;
    context.fillRect(0, 0, view.width, view.height);
  }
  rings.forEach((ring) => coverOutside(context, view, colours, ...ring));

  for (const [mine, other] of [rings, [...rings].reverse()]) {
    context.save();
    clipToRing(context, view, ...other);
    const [motor, near, far] = mine;
    for (const radius of [near + far, Math.abs(near - far)]) {
      context.beginPath();
      context.arc(...view.pixel(motor), radius * view.scale, 0, 2 * Math.PI);
      context.strokeStyle = colours.edge;
      context.lineWidth = 1.25;
      context.stroke();
    }
    context.restore();
  }
}

/** Draw a scale of lengths, and the axes of the hip frame. */
export function frame(context, view, colours) {
  const wanted = 70 / view.scale;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const step = power * [1, 2, 5, 10].find((each) => each * power >= wanted);
  const right = view.width - 16;
  const bottom = view.height - 18;
  const left = right - step * view.scale;
  context.strokeStyle = colours.muted;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(left, bottom - 4);
  context.lineTo(left, bottom);
  context.lineTo(right, bottom);
  context.lineTo(right, bottom - 4);
  context.stroke();
  const text = `${Number((step * 1000).toPrecision(3))} mm`;
  letters(context, colours, text, [(left + right) / 2, bottom - 12], { colour: colours.muted, size: 12 });

  const origin = [view.width - 58, 62];
  const faint = { colour: colours.muted, size: 12 };
  arrow(context, origin, add(origin, [34, 0]), colours.muted, 1.25);
  arrow(context, origin, add(origin, [0, -34]), colours.muted, 1.25);
  letters(context, colours, "x", add(origin, [42, 0]), faint);
  letters(context, colours, "z", add(origin, [0, -43]), faint);
}

/** Draw the links and joints. */
export function leg(context, view, colours, state) {
  const { A, E } = state.bases;
  const { B, C, D, F } = state.pose;
  const links = [
    [A, B, colours.A],
    [E, D, colours.E],
    [B, C, colours.A],
    [D, C, colours.E],
  ];
  const extended = state.lengths[5] > 0;
  if (extended) links.push([C, F, colours.A]);

  line(context, view, [A, E], { colour: colours.paper, width: CASING + 2 });
  line(context, view, [A, E], { colour: colours.muted, width: LINK });
  for (const [from, to] of links) {
    line(context, view, [from, to], { colour: colours.paper, width: CASING });
  }
  for (const [from, to, colour] of links) {
    line(context, view, [from, to], { colour, width: LINK });
  }

  for (const [motor, colour] of [
    [A, colours.A],
    [E, colours.E],
  ]) {
    circle(context, view.pixel(motor), MOTOR, colours.paper, colour, 4);
    circle(context, view.pixel(motor), 2.5, colour, colour, 1);
  }
  circle(context, view.pixel(B), JOINT, colours.paper, colours.A, 3);
  circle(context, view.pixel(D), JOINT, colours.paper, colours.E, 3);
  if (extended) circle(context, view.pixel(C), JOINT, colours.paper, colours.ink, 3);
  circle(context, view.pixel(F), JOINT + 3, colours.foot, colours.paper, 3);

  const middle = scaled([B, C, D, A, E].reduce(add), 0.2);
  const named = [
    ["A", A, colours.A, 24],
    ["E", E, colours.E, 24],
    ["B", B, colours.A, 20],
    ["D", D, colours.E, 20],
    ["C", C, extended ? colours.ink : colours.foot, 22],
  ];
  if (extended) named.push(["F", F, colours.foot, 22]);
  for (const [name, joint, colour, far] of named) {
    // Away from the middle of the leg, so that no letter lies on a link.
    const way = sub(view.pixel(joint), view.pixel(middle));
    const off = length(way) > 1 ? scaled(way, far / length(way)) : [0, far];
    letters(context, colours, name, add(view.pixel(joint), off), { colour, size: 15, bold: true });
  }
}

/** Draw what the foot can do with motors that turn at 1 rad/s together, to a scale of its own. */
export function ellipse(context, view, colours, state) {
  const { F, J } = state.pose;
  if (!J) return;
  const largest = Math.hypot(...J);
  const k = Math.min(1, (0.2 * state.size) / largest);
  const points = [];
  for (let turn = 0; turn < 64; turn++) {
    const [a, e] = polar(k, (turn * Math.PI) / 32);
    points.push(add(F, [J[0] * a + J[1] * e, J[2] * a + J[3] * e]));
  }
  line(context, view, points, { colour: colours.paper, width: 4, close: true });
  line(context, view, points, { colour: colours.singular, width: 2, close: true });
}

/** Return the tip of the force's arrow [m]. */
export function tip(state, largest) {
  return add(state.pose.F, scaled(state.force, (ARROW * state.size) / largest));
}

/** Draw the force on the foot; its arrow's tip is what is pulled. */
export function force(context, view, colours, state, largest) {
  const from = view.pixel(state.pose.F);
  const to = view.pixel(tip(state, largest));
  const long = apart(from, to);
  if (long > 12) {
    const start = between(from, to, 12 / long);
    const end = between(to, from, Math.min(8 / long, 0.5));
    arrow(context, start, end, colours.paper, 7);
    arrow(context, start, end, colours.force, 3.5);
  }
  circle(context, to, 6, colours.paper, colours.force, 2.5);
  const newtons = length(state.force);
  const beyond = direction(long > 12 ? sub(to, from) : [1, -1]);
  // The number stays in sight wherever the arrow points.
  const within = (value, most, margin) => Math.min(Math.max(value, margin), most - margin);
  const at = [
    within(to[0] + Math.cos(beyond) * 30, view.width, 30),
    within(to[1] + Math.sin(beyond) * 18, view.height, 14),
  ];
  letters(context, colours, `${newtons.toFixed(1)} N`, at, { colour: colours.force, size: 13, bold: true });
}

/** Draw where the foot was wanted, if that is out of reach. */
export function target(context, view, colours, state) {
  if (apart(state.target, state.foot) * view.scale < 1) return;
  const at = view.pixel(state.target);
  line(context, view, [state.foot, state.target], { colour: colours.foot, width: 1.5, dash: [4, 4] });
  context.strokeStyle = colours.foot;
  context.lineWidth = 2;
  context.beginPath();
  for (const [x, y] of [[1, 1], [1, -1]]) {
    context.moveTo(at[0] - 6 * x, at[1] - 6 * y);
    context.lineTo(at[0] + 6 * x, at[1] + 6 * y);
  }
  context.stroke();
}
