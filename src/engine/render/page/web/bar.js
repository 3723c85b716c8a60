// The colour bar: the colours of values, handles at the ends of their range, how common values are, and their opacities.

const BARS = 64, MOST_POINTS = 16; // bars of the histogram, and points that a request may have
const HANDLE = 6; // the radius of a point
const REACH = 14; // pixels from a point within which it is taken

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

// How common the numbers of a plane are, from every so many of them.
function countsOf(plane, [low, high]) {
  const bars = new Array(BARS).fill(0), every = Math.ceil(plane.length / 65536);
  for (let i = 0; i < plane.length; i += every) {
    const at = (plane[i] - low) / (high - low) * BARS;
    if (at >= 0 && at <= BARS) bars[Math.min(Math.floor(at), BARS - 1)]++;
  }
  return bars;
}

// The points of a line that matter most: enough that the rest is near the line between them.
function simplified(points) {
  const near = 0.01 * Math.max(...points.map(([, opacity]) => opacity)), kept = [0, points.length - 1];
  const estimate = n => {
    const next = kept.findIndex(other => other > n), [[a, below], [b, above]] = [points[kept[next - 1]], points[kept[next]]];
    return below + (points[n][0] - a) / (b - a) * (above - below);
  };
  while (kept.length < MOST_POINTS / 2) {
    const off = points.map(([, opacity], n) => kept.includes(n) ? 0 : Math.abs(opacity - estimate(n))), most = Math.max(...off);
    if (!(most > near)) break;
    kept.push(off.indexOf(most));
    kept.sort((a, b) => a - b);
  }
  return kept.map(n => points[n].map(number => Number(number.toFixed(3))));
}

const clamped = (number, least, most) => Math.min(Math.max(number, least), most);

class Bar {
  // `ranged` gets a range that the user sets, and whether it still moves; `opaque` gets points of opacities.
  constructor(ranged) {
    this.ranged = ranged;
    this.opaque = null;
    this.scale = null;
    this.domain = [0, 1]; // the values at both ends of the bar
    this.points = null; // shares of the range and their opacities, if values have opacities
    this.line = null; // opacities that are suggested, at more shares than there are points
    this.counts = [];
    ['low-end', 'high-end'].forEach((id, end) => this.listenToEnd(element(id), end));
    this.listenToPoints(element('bar-plot'));
    new ResizeObserver(() => { if (this.scale) this.draw(); }).observe(element('bar-box'));
  }

  // Shows a scale. The bar reaches over its range, and over the automatic one.
  show(scale, automatic, paintStrip) {
    this.scale = scale;
    this.paintStrip = paintStrip;
    const ends = [...scale.range, ...automatic].filter(end => !scale.log || end > 0);
    if (!this.isEndHeld) this.domain = [Math.min(...ends), Math.max(...ends)];
    this.draw();
  }

  // The place of a value on the bar, 0 to 1, and the value at a place.
  place(value) {
    const [low, high, at] = [...this.domain, value].map(number => this.bent(number));
    return high > low ? (at - low) / (high - low) : 0;
  }

  value(place) {
    const [low, high] = this.domain.map(number => this.bent(number)), at = low + place * (high - low);
    return this.scale.log ? Math.exp(at) : at;
  }

  bent(value) { return this.scale.log ? Math.log(Math.max(value, Number.MIN_VALUE)) : value; }

  // The place under the pointer; beyond 0 and 1 as well.
  placeOf({ clientX }) {
    const { left, width } = element('bar-box').getBoundingClientRect();
    return (clientX - left) / width;
  }

  // In steps that show: of the bar, or of the value itself.
  rounded(value) {
    const length = this.domain[1] - this.domain[0];
    return rounded(value, this.scale.log ? Math.min(value, length) : length);
  }

  listenToEnd(handle, end) {
    const moved = (place, isMoving) => {
      const least = 0.005, other = this.place(this.scale.range[1 - end]);
      const within = end ? clamped(place, other + least, 1.5) : clamped(place, -0.5, other - least);
      const range = [...this.scale.range];
      range[end] = this.rounded(this.value(within));
      if (!(range[0] < range[1])) return;
      this.isMoved = isMoving;
      this.ranged(range, isMoving);
    };
    handle.addEventListener('pointerdown', event => { if (event.button === 0) this.isEndHeld = true; handle.setPointerCapture(event.pointerId); });
    handle.addEventListener('pointermove', event => { if (this.isEndHeld && event.buttons) moved(this.placeOf(event), true); });
    for (const name of ['pointerup', 'pointercancel']) handle.addEventListener(name, () => this.release());
    handle.addEventListener('keydown', ({ key }) => {
      const by = { ArrowLeft: -0.01, ArrowDown: -0.01, ArrowRight: 0.01, ArrowUp: 0.01 }[key];
      if (by) moved(this.place(this.scale.range[end]) + by, false);
    });
  }

  release() {
    const { isMoved } = this;
    this.isEndHeld = this.isMoved = false;
    if (isMoved) this.ranged(this.scale.range, false);
  }

  listenToPoints(plot) {
    plot.addEventListener('pointerdown', event => { this.heldPoint = event.button === 0 ? this.point(event) : -1; plot.setPointerCapture(event.pointerId); });
    plot.addEventListener('pointermove', event => { if (this.heldPoint >= 0 && event.buttons) this.movePoint(event); });
    for (const end of ['pointerup', 'pointercancel']) plot.addEventListener(end, () => { this.heldPoint = -1; });
    plot.addEventListener('dblclick', event => this.togglePoint(event));
  }

  // Follows opacities: those of a picture, or none. Points that the user holds stay.
  follow(opacity, isSuggested) {
    if (!opacity && !this.points) return; // values have none
    if (!(this.heldPoint >= 0) && (isSuggested || !opacity || !this.points)) {
      this.line = opacity && isSuggested ? opacity : null;
      this.points = opacity && (isSuggested ? simplified(opacity) : opacity);
    }
    this.drawPlot();
  }

  // The pixel of a point of opacity.
  pixel([share, opacity]) {
    const { width, height } = this.size, { range: [low, high] } = this.scale;
    return [width * this.place(low + share * (high - low)), height - opacity * height];
  }

  get size() {
    const { clientWidth, clientHeight } = element('bar-plot');
    return { width: Math.max(clientWidth, 1), height: Math.max(clientHeight, 1) };
  }

  // The share of the range and the opacity under the pointer.
  at(event) {
    const box = element('bar-plot').getBoundingClientRect(), { range: [low, high] } = this.scale, digits = number => Number(clamped(number, 0, 1).toFixed(3));
    return [digits((this.value(this.placeOf(event)) - low) / (high - low)), digits(1 - (event.clientY - box.top) / box.height)];
  }

  // The number of the point under the pointer, or -1.
  point({ clientX, clientY }) {
    const box = element('bar-plot').getBoundingClientRect();
    const away = (this.points ?? []).map(point => this.pixel(point)).map(([x, y]) => Math.hypot(clientX - box.left - x, clientY - box.top - y));
    const least = Math.min(...away);
    return least <= REACH ? away.indexOf(least) : -1;
  }

  movePoint(event) {
    const [share, opacity] = this.at(event), n = this.heldPoint, last = this.points.length - 1;
    const low = n ? this.points[n - 1][0] + 0.002 : 0, high = n < last ? this.points[n + 1][0] - 0.002 : 1;
    this.points[n] = [n === 0 ? 0 : n === last ? 1 : low < high ? clamped(share, low, high) : this.points[n][0], opacity];
    this.give();
  }

  togglePoint(event) {
    const n = this.point(event), last = (this.points?.length ?? 0) - 1;
    if (last < 1 || n === 0 || n === last) return;
    if (n > 0) this.points.splice(n, 1);
    if (n < 0 && this.points.length < MOST_POINTS) this.points = [...this.points, this.at(event)].sort((a, b) => a[0] - b[0]);
    this.give();
  }

  give() {
    this.line = null;
    this.drawPlot();
    this.opaque(this.points.map(point => [...point]));
  }

  draw() {
    const strip = element('bar-colours'), context = strip.getContext('2d'), image = context.createImageData(strip.width, 1);
    image.data.fill(255);
    this.paintStrip(Float32Array.from({ length: strip.width }, (_, i) => this.value(i / (strip.width - 1))), image.data);
    context.putImageData(image, 0, 0);
    const marks = ticks({ log: this.scale.log, range: this.domain }), room = element('bar-box').clientWidth / 60;
    const every = Math.max(1, Math.ceil(marks.length / Math.max(room, 2)));
    element('bar-ticks').replaceChildren(...marks.filter((_, n) => n % every === 0).map(value => textAt(shortNumber(value), this.place(value))));
    ['low-end', 'high-end'].forEach((id, end) => {
      const handle = element(id), value = this.scale.range[end];
      handle.style.left = `${100 * clamped(this.place(value), 0, 1)}%`;
      Object.assign(handle, { ariaValueText: shortNumber(value), ariaValueNow: value, ariaValueMin: this.domain[0], ariaValueMax: this.domain[1] });
    });
    this.drawPlot();
  }

  showCounts(counts) {
    this.counts = counts;
    this.drawPlot();
  }

  // The histogram and the opacities over it.
  drawPlot() {
    if (!this.scale) return;
    const { width, height } = this.size, plot = element('bar-plot'), most = Math.log1p(Math.max(...this.counts, 1));
    const part = (this.domain[1] - this.domain[0]) / BARS, edge = n => width * this.place(this.domain[0] + n * part);
    const bars = this.counts.map((count, n) => {
      const tall = height * Math.log1p(count) / most;
      return shape('rect', { x: edge(n), y: height - tall, width: Math.max(edge(n + 1) - edge(n), 0), height: tall });
    });
    const line = this.points ? [shape('polyline', { points: (this.line ?? this.points).map(point => this.pixel(point)).join(' ') })] : [];
    const dots = (this.points ?? []).map(point => this.pixel(point)).map(([cx, cy]) => shape('circle', { cx, cy, r: HANDLE }));
    plot.setAttribute('viewBox', `0 0 ${width} ${height}`);
    plot.replaceChildren(...bars, ...line, ...dots);
  }
}

// A number that changes in small steps of a range.
function rounded(number, range) {
  const step = 10 ** Math.floor(Math.log10(range) - 3);
  return range > 0 ? Number((Math.round(number / step) * step).toPrecision(12)) : number;
}

// A text at a share of a line.
function textAt(text, share) {
  const span = document.createElement('span');
  span.textContent = text;
  span.style.left = `${100 * share}%`;
  return span;
}
