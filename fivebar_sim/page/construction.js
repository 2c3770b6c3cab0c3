// The construction of the mechanism: the triangles from which the formulas come, on the leg itself.

import { letters, line } from "./draw.js";
import { add, apart, between, direction, length, polar, scaled, sub, wrapped } from "./plane.js";

const DASH = [6, 4];

function filled(context, view, points, colour) {
  context.beginPath();
  points.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...view.pixel(point)));
  context.closePath();
  context.globalAlpha = 0.13;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
}

/** Draw the arc of an angle at a joint from one direction on, with an arrow at its end. */
function arc(context, view, colours, { at, radius, from, angle, text, colour, share = 0.5 }) {
  const centre = view.pixel(at);
  const to = from + angle;
  context.beginPath();
  // Pixels run downwards, so angles run the other way round.
  context.arc(...centre, radius, -from, -to, angle > 0);
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.stroke();
  if (Math.abs(angle) * radius > 8) {
    const end = add(centre, [radius * Math.cos(to), -radius * Math.sin(to)]);
    const along = to + (angle > 0 ? Math.PI / 2 : -Math.PI / 2) - (angle > 0 ? 1 : -1) * (4 / radius);
    const u = [Math.cos(along), -Math.sin(along)];
    context.beginPath();
    for (const side of [-1, 0, 1]) {
      const point = side === 0 ? end : sub(end, add(scaled(u, 7), scaled([-u[1], u[0]], 3.5 * side)));
      context[side === -1 ? "moveTo" : "lineTo"](...point);
    }
    context.stroke();
  }
  const middle = from + angle * share;
  const label = add(centre, [(radius + 13) * Math.cos(middle), -(radius + 13) * Math.sin(middle)]);
  letters(context, colours, text, label, { colour, size: 14 });
}

function beside(context, view, colours, from, to, text, colour) {
  const a = view.pixel(from);
  const b = view.pixel(to);
  const long = apart(a, b);
  if (long < 24) return;
  const normal = scaled([-(b[1] - a[1]), b[0] - a[0]], 14 / long);
  letters(context, colours, text, add(between(a, b, 0.55), normal), { colour, size: 14 });
}

/** The inverse: alpha, the direction of the line from the motor to the chain's end, and beta. */
export function inverse(context, view, colours, state) {
  const { A, E } = state.bases;
  const { B, C, D, F } = state.pose;
  const sides = [
    { motor: A, knee: B, end: F, colour: colours.A, name: "A", theta: state.pose.theta[0] },
    { motor: E, knee: D, end: C, colour: colours.E, name: "E", theta: state.pose.theta[1] },
  ];
  for (const { motor, knee, end, colour } of sides) filled(context, view, [motor, knee, end], colour);
  for (const { motor, end, colour, name, theta } of sides) {
    const ground = add(motor, [62 / view.scale, 0]);
    line(context, view, [motor, ground], { colour: colours.muted, width: 1.25, dash: [2, 3] });
    line(context, view, [motor, end], { colour, width: 1.75, dash: DASH });
    beside(context, view, colours, motor, end, `d_${name}`, colour);
    const alpha = direction(sub(end, motor));
    const beta = wrapped(theta - alpha);
    const first = { at: motor, radius: 32, from: 0, angle: alpha, text: `α_${name}`, share: 0.3 };
    arc(context, view, colours, { ...first, colour: colours.ink });
    arc(context, view, colours, { at: motor, radius: 52, from: alpha, angle: beta, text: `β_${name}`, colour });
  }
}

/** The forward: d and phi, the length and direction of BD, and C at a along it and h beside it. */
export function forward(context, view, colours, state) {
  const { B, C, D } = state.pose;
  const [, L2, L3] = state.lengths;
  const BD = sub(D, B);
  const d = length(BD);
  if (d * view.scale < 1) return;
  const a = (d * d + (L2 - L3) * (L2 + L3)) / (2 * d);
  const foot = add(B, scaled(BD, a / d));
  const { A, E } = state.bases;
  for (const [motor, theta, colour, name] of [
    [A, state.pose.theta[0], colours.A, "θ_A"],
    [E, state.pose.theta[1], colours.E, "θ_E"],
  ]) {
    const ground = add(motor, [52 / view.scale, 0]);
    line(context, view, [motor, ground], { colour: colours.muted, width: 1.25, dash: [2, 3] });
    arc(context, view, colours, { at: motor, radius: 32, from: 0, angle: theta, text: name, colour });
  }
  filled(context, view, [B, C, D], colours.singular);
  line(context, view, [B, D], { colour: colours.singular, width: 1.75, dash: DASH });
  line(context, view, [foot, C], { colour: colours.singular, width: 1.75, dash: DASH });
  line(context, view, [B, add(B, [46 / view.scale, 0])], { colour: colours.muted, width: 1.25, dash: [2, 3] });
  const phi = direction(BD);
  arc(context, view, colours, { at: B, radius: 34, from: 0, angle: phi, text: "φ", colour: colours.singular });
  beside(context, view, colours, D, B, "d", colours.singular);
  beside(context, view, colours, foot, C, "h", colours.singular);
  const tick = scaled(polar(1, phi), 9 / view.scale);
  const up = [-tick[1], tick[0]];
  const side = state.pose.assembly;
  const corner = [add(foot, tick), add(add(foot, tick), scaled(up, side)), add(foot, scaled(up, side))];
  line(context, view, corner, { colour: colours.singular, width: 1.25 });
}
