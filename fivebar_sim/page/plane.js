// Plane vectors [x, z], and the window through which the leg's plane is seen.

export const sub = (a, b) => [a[0] - b[0], a[1] - b[1]];
export const add = (a, b) => [a[0] + b[0], a[1] + b[1]];
export const scaled = (a, k) => [a[0] * k, a[1] * k];
export const cross = (a, b) => a[0] * b[1] - a[1] * b[0];
export const length = (a) => Math.hypot(a[0], a[1]);
export const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
export const direction = (a) => Math.atan2(a[1], a[0]);
export const polar = (r, angle) => [r * Math.cos(angle), r * Math.sin(angle)];
export const between = (a, b, share) => [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];

/** Return an angle brought to (-pi, pi]. */
export function wrapped(angle) {
  const turned = angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
  return turned <= -Math.PI ? Math.PI : turned;
}

/** A window on the plane: metres to pixels of the canvas, z up. */
export class View {
  constructor() {
    this.width = 1;
    this.height = 1;
    this.scale = 1;
    this.middle = [0, 0];
  }

  /** Show a box [m] with a margin [px] all around. */
  fit(width, height, low, high, margin) {
    this.width = width;
    this.height = height;
    const across = Math.max(width - 2 * margin, 1) / (high[0] - low[0]);
    const up = Math.max(height - 2 * margin, 1) / (high[1] - low[1]);
    this.scale = Math.min(across, up);
    this.middle = between(low, high, 0.5);
  }

  pixel(p) {
    return [
      this.width / 2 + (p[0] - this.middle[0]) * this.scale,
      this.height / 2 - (p[1] - this.middle[1]) * this.scale,
    ];
  }

  point(pixel) {
    return [
      this.middle[0] + (pixel[0] - this.width / 2) / this.scale,
      this.middle[1] - (pixel[1] - this.height / 2) / this.scale,
    ];
  }
}
