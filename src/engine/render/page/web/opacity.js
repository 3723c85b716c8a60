// The editor of opacities.

const BARS = 64, MOST_POINTS = 16; // bars of the histogram, and points that a request may have
const EDGE = 9, HANDLE = 6.5; // pixels around the plot, and the radius of a handle

// How common samples are, of some frames or of one; nothing if the server does not say.
async function howCommon(of = {}) {
  const answer = await fetch(`histogram?${new URLSearchParams(of)}`).catch(() => null);
  return answer?.ok ? answer.json() : null;
}

// How many samples lie in each of even parts of a range.
function countsOver([low, high], { range: [first, last], counts }) {
  const bars = new Array(BARS).fill(0), part = BARS / (high - low), width = Math.max((last - first) / counts.length * part, 1e-9);
  counts.forEach((count, n) => {
    const from = (first - low) * part + n * width, to = from + width;
    for (let bar = Math.max(Math.floor(from), 0); bar < Math.min(to, BARS); bar++) {
      bars[bar] += count * (Math.min(to, bar + 1) - Math.max(from, bar)) / width;
    }
  });
  return bars;
}

// The points of a line that matter most: enough that the rest is near the line between them.
function simplified(points) {
  const near = 0.01 * Math.max(...points.map(([, opacity]) => opacity)), kept = [0, points.length - 1];
  const between = n => {
    const next = kept.findIndex(other => other > n), [[a, below], [b, above]] = [points[kept[next - 1]], points[kept[next]]];
    return below + (points[n][0] - a) / (b - a) * (above - below);
  };
  while (kept.length < MOST_POINTS / 2) {
    const off = points.map(([, opacity], n) => kept.includes(n) ? 0 : Math.abs(opacity - between(n))), most = Math.max(...off);
    if (!(most > near)) break;
    kept.push(off.indexOf(most));
    kept.sort((a, b) => a - b);
  }
  return kept.map(n => points[n].map(number => Number(number.toFixed(3))));
}

// Points of opacity over shares of the range of colours, in front of how common values are.
class OpacityEditor {
  constructor(changed) {
    this.changed = changed;
    this.points = [[0, 0], [1, 0.6]];
    this.line = null; // opacities that are suggested, at more shares than there are points
    const plot = element('opacity');
    plot.addEventListener('pointerdown', event => { this.held = this.handle(event); plot.setPointerCapture(event.pointerId); });
    plot.addEventListener('pointermove', event => { if (this.held >= 0 && event.buttons) this.move(event); });
    for (const end of ['pointerup', 'pointercancel']) plot.addEventListener(end, () => { this.held = -1; });
    plot.addEventListener('dblclick', event => this.toggle(event));
    element('opacity-auto').addEventListener('click', () => this.changed(null));
    new ResizeObserver(() => this.draw()).observe(plot);
  }

  async open() {
    if (this.isOpen) return;
    this.isOpen = true;
    this.common = await howCommon();
    this.isOpen = this.common !== null;
    this.draw();
  }

  // Follows the range of the picture, and opacities that are suggested for it.
  follow(suggested, range) {
    this.range = range;
    if (suggested && !(this.held >= 0)) {
      this.line = suggested;
      this.points = simplified(suggested);
    }
    this.draw();
  }

  get size() {
    const { clientWidth, clientHeight } = element('opacity');
    return [Math.max(clientWidth, 4 * EDGE), Math.max(clientHeight, 4 * EDGE)];
  }

  // The pixel of a point.
  place([share, opacity]) {
    const [width, height] = this.size;
    return [EDGE + share * (width - 2 * EDGE), height - EDGE - opacity * (height - 2 * EDGE)];
  }

  pixel({ clientX, clientY }) {
    const box = element('opacity').getBoundingClientRect();
    return [clientX - box.left - element('opacity').clientLeft, clientY - box.top - element('opacity').clientTop];
  }

  at(event) {
    const [x, y] = this.pixel(event), [width, height] = this.size, within = share => Number(Math.min(Math.max(share, 0), 1).toFixed(3));
    return [within((x - EDGE) / (width - 2 * EDGE)), within((height - EDGE - y) / (height - 2 * EDGE))];
  }

  // The number of the point under the pointer, or -1.
  handle(event) {
    const [x, y] = this.pixel(event), away = this.points.map(point => this.place(point)).map(([a, b]) => Math.hypot(x - a, y - b));
    const least = Math.min(...away);
    return least <= 2 * HANDLE ? away.indexOf(least) : -1;
  }

  move(event) {
    const [share, opacity] = this.at(event), n = this.held, last = this.points.length - 1;
    const low = n ? this.points[n - 1][0] + 0.002 : 0, high = n < last ? this.points[n + 1][0] - 0.002 : 1;
    this.points[n] = [n === 0 ? 0 : n === last ? 1 : Math.min(Math.max(share, low), high), opacity];
    this.give();
  }

  toggle(event) {
    const n = this.handle(event), last = this.points.length - 1;
    if (n > 0 && n < last) this.points.splice(n, 1);
    if (n < 0 && this.points.length < MOST_POINTS) this.points = [...this.points, this.at(event)].sort((a, b) => a[0] - b[0]);
    this.give();
  }

  give() {
    this.line = null;
    this.draw();
    this.changed(this.points.map(point => [...point]));
  }

  draw() {
    const [width, height] = this.size, bar = (width - 2 * EDGE) / BARS, plot = element('opacity');
    const counts = this.common?.range && this.range ? countsOver(this.range, this.common) : [], most = Math.log1p(Math.max(...counts, 1));
    const bars = counts.map((count, n) => {
      const tall = (height - 2 * EDGE) * Math.log1p(count) / most;
      return shape('rect', { x: EDGE + n * bar, y: height - EDGE - tall, width: bar, height: tall });
    });
    const line = shape('polyline', { points: (this.line ?? this.points).map(point => this.place(point)).join(' ') });
    const dots = this.points.map(point => this.place(point)).map(([cx, cy]) => shape('circle', { cx, cy, r: HANDLE }));
    plot.setAttribute('viewBox', `0 0 ${width} ${height}`);
    plot.replaceChildren(...bars, line, ...dots);
  }
}
