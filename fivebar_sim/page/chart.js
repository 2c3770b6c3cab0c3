// What the path asks of the motors: angles and torques over one loop, as two small charts.

const PAD = { left: 46, right: 10, top: 20, bottom: 8 };

/** Draw one chart: two lines over the phase. */
function chart(context, colours, box, { title, unit, values, rows }) {
  const good = rows.filter((row) => row.ok).flatMap(values);
  const { x, y, width, height } = box;
  const left = x + PAD.left;
  const right = x + width - PAD.right;
  const top = y + PAD.top;
  const bottom = y + height - PAD.bottom;
  const [low, high] = range(good);
  const across = (k) => left + (k / rows.length) * (right - left);
  const up = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);

  context.font = `12px ${colours.font}`;
  context.textBaseline = "middle";
  context.fillStyle = colours.muted;
  context.textAlign = "left";
  context.fillText(`${title} [${unit}]`, left, y + 9);
  context.textAlign = "right";
  for (const value of [low, high]) {
    context.fillText(short(value), left - 7, up(value));
    context.fillStyle = colours.grid;
    context.fillRect(left, Math.round(up(value)), right - left, 1);
    context.fillStyle = colours.muted;
  }
  if (low < 0 && high > 0) {
    context.fillStyle = colours.grid;
    context.fillRect(left, Math.round(up(0)), right - left, 1);
  }

  for (const side of [0, 1]) {
    context.beginPath();
    let pen = false;
    for (let k = 0; k <= rows.length; k++) {
      const row = rows[k % rows.length];
      if (row.ok) context[pen ? "lineTo" : "moveTo"](across(k), up(values(row)[side]));
      pen = row.ok;
    }
    context.strokeStyle = side === 0 ? colours.A : colours.E;
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.stroke();
  }
}

/** Return round ends for some values. */
function range(values) {
  if (values.length === 0) return [-1, 1];
  let low = Math.min(...values);
  let high = Math.max(...values);
  const span = Math.max(high - low, 1e-3 * Math.max(Math.abs(high), Math.abs(low)), 1e-9);
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  low = Math.floor(low / step) * step;
  high = Math.ceil(high / step) * step;
  return low === high ? [low - step, high + step] : [low, high];
}

const short = (value) => Number(value.toPrecision(3)).toString().replace("-", "\u2212");

const DEGREES = 180 / Math.PI;

const WHAT = [
  { title: "angles over the path", unit: "deg", values: (row) => row.theta.map((angle) => angle * DEGREES) },
  { title: "torques over the path", unit: "N m", values: (row) => row.tau },
];

/** Both charts. They are drawn when the path, the leg or the force changes; while the path is played
 * only the marks move. */
export class Charts {
  constructor(canvas) {
    this.canvas = canvas;
    this.marks = WHAT.map(() => canvas.parentElement.appendChild(document.createElement("i")));
    this.key = "";
  }

  show(colours, path) {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    const boxes = placed(width, height);
    const key = [path.made, path.key, width, height, ratio, colours.key].join();
    if (key !== this.key) {
      this.key = key;
      this.canvas.width = width * ratio;
      this.canvas.height = height * ratio;
      const context = this.canvas.getContext("2d");
      context.scale(ratio, ratio);
      WHAT.forEach((what, k) => chart(context, colours, boxes[k], { ...what, rows: path.rows }));
    }
    boxes.forEach((box, k) => {
      const x = box.x + PAD.left + path.phase * (box.width - PAD.left - PAD.right);
      this.marks[k].style.transform = `translate(${x}px, ${box.y + PAD.top}px)`;
      this.marks[k].style.height = `${box.height - PAD.top - PAD.bottom}px`;
    });
  }
}

/** Return the boxes of the charts: side by side if there is room. */
function placed(width, height) {
  const beside = width > 560;
  return [0, 1].map((k) =>
    beside
      ? { x: (k * width) / 2, y: 0, width: width / 2, height }
      : { x: 0, y: (k * height) / 2, width, height: height / 2 },
  );
}
