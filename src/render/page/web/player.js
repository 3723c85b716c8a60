// Shows the pictures of a source: the time slider, the colours, and what lies under the pointer.
//
// A source has `sequences`, lists of pictures with their view and frame; `about`, a first description of them; and
// `picture(sequence, index)`, which promises the planes of a picture, its own description, and the RGBA bytes behind it.

const element = id => document.getElementById(id);

// A number with four digits; with a power of ten if it is very large or small.
function shortNumber(number) {
  const size = Math.abs(number), isPlain = size === 0 || (size >= 1e-3 && size < 1e5);
  return isPlain ? String(Number(number.toPrecision(4))) : Number(number.toPrecision(4)).toExponential().replace('e+', 'e');
}

class Player {
  constructor(source) {
    this.source = source;
    this.sequence = 0;
    this.index = 0;
    this.shown = null;
    this.isPlaying = false;
    this.context = element('picture').getContext('2d');
    element('sequence').replaceChildren(...source.sequences.map(({ label }, n) => new Option(label, n)));
    element('views').hidden = source.sequences.length < 2;
    this.adopt(source.about);
    this.beginTime();
    this.listen();
    this.show();
  }

  get pictures() { return this.source.sequences[this.sequence].pictures; }

  // Follows the description of pictures. The colours begin anew if these are of another kind.
  adopt(about) {
    const isOther = about.key !== this.about?.key || about.kind !== this.about?.kind;
    this.about = about;
    document.documentElement.classList.toggle('light', about.background[1] > 127);
    document.title = element('title').textContent = about.title || about.values || 'wavesplat';
    element('provenance').textContent = JSON.stringify(about.settings, null, 1);
    const picture = element('picture');
    if (picture.width !== about.size[0] || picture.height !== about.size[1] || !this.image) {
      [picture.width, picture.height] = about.size;
      this.image = this.context.createImageData(...about.size);
      this.image.data.fill(255);
    }
    if (isOther) this.beginColours();
  }

  beginColours() {
    const { about } = this, isOfValues = about.kind === 'value', chosen = element('map').value;
    element('bar').style.visibility = isOfValues || about.hasBar ? 'visible' : 'hidden';
    element('colours').hidden = !isOfValues && !about.hasBar;
    element('log-control').hidden = element('gamma-control').hidden = !isOfValues;
    element('map').replaceChildren(...Object.keys(about.maps).map(name => new Option(name)));
    element('bar-name').textContent = about.values;
    this.resetColours();
    if (chosen in about.maps && about.key && isOfValues) element('map').value = chosen;
    this.recolour();
  }

  resetColours() {
    const { about } = this;
    element('map').value = about.map;
    [element('low').value, element('high').value] = about.range.map(shortNumber);
    this.range = about.range;
    element('log').checked = about.log;
    element('gamma').value = 0;
    this.recolour();
  }

  beginTime() {
    const last = this.pictures.length - 1;
    element('frame').max = last;
    element('time').style.visibility = last ? 'visible' : 'hidden';
    this.index = Math.min(this.index, last);
  }

  listen() {
    const on = (id, event, action) => element(id).addEventListener(event, action);
    on('play', 'click', () => this.play(!this.isPlaying));
    on('frame', 'input', () => this.show(Number(element('frame').value)));
    on('sequence', 'change', () => this.choose(Number(element('sequence').value)));
    for (const id of ['map', 'log', 'gamma']) on(id, 'input', () => this.recolour());
    for (const id of ['low', 'high']) on(id, 'change', () => this.chooseRange());
    on('reset', 'click', () => { this.resetColours(); this.source.reset?.(); });
    on('save', 'click', () => this.save());
    on('picture', 'pointermove', event => this.read(event));
    on('picture', 'pointerleave', () => { this.pointer = null; element('readout').textContent = ''; });
    on('picture', 'click', event => this.plot(event));
    document.addEventListener('keydown', event => this.key(event));
  }

  key(event) {
    if (event.target.matches('input, select, textarea') || event.ctrlKey || event.metaKey || event.altKey) return;
    const last = this.pictures.length - 1;
    const actions = {
      ' ': () => this.play(!this.isPlaying),
      ArrowRight: () => this.show(Math.min(this.index + 1, last)),
      ArrowLeft: () => this.show(Math.max(this.index - 1, 0)),
      Home: () => this.show(0),
      End: () => this.show(last),
      v: () => this.choose((this.sequence + 1) % this.source.sequences.length),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  choose(sequence) {
    this.sequence = sequence;
    element('sequence').value = sequence;
    this.beginTime();
    this.show();
  }

  chooseRange() {
    const range = ['low', 'high'].map(id => element(id).valueAsNumber);
    if (range.every(Number.isFinite) && range[0] < range[1]) this.range = range;
    [element('low').value, element('high').value] = this.range.map(shortNumber);
    this.recolour();
    this.source.ranged?.(this.range);
  }

  // Makes the colours anew, and draws with them.
  recolour() {
    const { about } = this, log = element('log');
    log.disabled = this.range[0] <= 0;
    const table = tableOf(about.maps[element('map').value]), gamma = 2 ** -element('gamma').value;
    this.scale = new Scale({ table, range: this.range, log: log.checked, gamma, clear: about.clear });
    this.drawBar();
    this.draw();
  }

  drawBar() {
    const bar = element('bar-colours'), context = bar.getContext('2d'), image = context.createImageData(1, bar.height);
    const values = Float32Array.from({ length: bar.height }, (_, i) => this.scale.value(1 - i / (bar.height - 1)));
    image.data.fill(255);
    paint([values], 'value', this.scale, this.plainBackground(bar.height), image.data);
    context.putImageData(image, 0, 0);
    const tick = value => {
      const span = document.createElement('span');
      span.textContent = shortNumber(value);
      span.style.top = `${100 * (1 - this.scale.share(value))}%`;
      return span;
    };
    element('bar-ticks').replaceChildren(...ticks(this.scale).map(tick));
  }

  plainBackground(pixels) {
    const rgba = new Uint8ClampedArray(4 * pixels);
    for (let i = 0; i < rgba.length; i++) rgba[i] = i % 4 < 3 ? this.about.background[i % 4] : 255;
    return rgba;
  }

  // Shows a picture as soon as it is there. Only the last request counts.
  async show(index = this.index) {
    this.index = index;
    element('frame').value = index;
    const asked = [this.sequence, index], { frame } = this.pictures[index];
    element('label').textContent = this.about.labels[frame] ?? `frame ${frame}`;
    const shown = await this.source.picture(...asked, this.isPlaying).catch(problem);
    if (!shown || asked[0] !== this.sequence || asked[1] !== this.index) return;
    if (shown.about !== this.about) this.adopt(shown.about);
    this.shown = shown;
    this.draw();
    if (this.pointer) this.read(this.pointer);
    if (this.series) this.drawSeries(this.series.values, this.series.name);
  }

  draw() {
    const { planes, backdrop, about } = this.shown ?? {};
    if (!planes || planes[0].length * 4 !== this.image.data.length) return;
    paint(planes, about.kind, this.scale, backdrop ?? this.plainBackground(planes[0].length), this.image.data);
    this.context.putImageData(this.image, 0, 0);
    document.documentElement.dataset.drawn = `${this.sequence}:${this.index}`;
  }

  play(isPlaying) {
    this.isPlaying = isPlaying;
    element('play').textContent = isPlaying ? 'Pause' : 'Play';
    if (isPlaying) this.run();
  }

  // Shows one picture after another, none before the one before it is there.
  async run() {
    let due = performance.now();
    while (this.isPlaying) {
      const last = this.pictures.length - 1;
      if (this.index === last && !element('loop').checked) return this.play(false);
      await this.show(this.index === last ? 0 : this.index + 1);
      due = Math.max(due + 1000 / (this.about.fps * element('speed').value), performance.now());
      await new Promise(next => setTimeout(next, due - performance.now()));
    }
  }

  // The pixel under the pointer.
  pixel(event) {
    const canvas = element('picture'), box = canvas.getBoundingClientRect();
    const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
    const at = (pointer, start, length, pixels) => Math.floor((pointer - start - (length - pixels * scale) / 2) / scale);
    const x = at(event.clientX, box.left, box.width, canvas.width), y = at(event.clientY, box.top, box.height, canvas.height);
    return x >= 0 && y >= 0 && x < canvas.width && y < canvas.height ? { x, y, i: y * canvas.width + x } : null;
  }

  read(event) {
    this.pointer = event;
    const at = this.pixel(event), { about } = this;
    if (!at || !this.shown) return;
    const { planes: [values], beneath } = this.shown, value = values[at.i];
    const text = Number.isNaN(value) ? 'no value' : `${shortNumber(value)}${about.values ? `  ${about.values}` : ''}`;
    const of = beneath ? `, value ${shortNumber(beneath[at.i])},` : '';
    const place = this.source.place?.(event) ?? `pixel ${at.x}, ${at.y}`, time = element('label').textContent;
    element('readout').textContent = `${about.kind === 'value' ? `${text}${of} at ` : ''}${place}, ${time}`;
  }

  // Plots the values of a pixel over time.
  async plot(event) {
    const at = this.pixel(event), { about } = this;
    if (!at || this.source.wasDragged?.() || about.kind !== 'value' || this.pictures.length < 2) return;
    if (await this.source.plot?.(event)) return;
    const sequence = this.sequence, values = [];
    this.plotted = at.i;
    for (let n = 0; n < this.pictures.length; n++) {
      values.push((await this.source.picture(sequence, n)).planes[0][at.i]);
      if (this.plotted !== at.i || sequence !== this.sequence) return;
    }
    this.drawSeries(values, `${about.values || 'Values'} at pixel ${at.x}, ${at.y}`);
  }

  // A line through values; it breaks where there is none. Another marks the time.
  drawSeries(values, name) {
    this.series = { values, name };
    const known = values.filter(Number.isFinite), last = Math.max(values.length - 1, 1);
    const low = Math.min(...known), high = Math.max(...known), height = high > low ? 180 / (high - low) : 0;
    const point = (value, n) => `${600 * n / last},${190 - (value - low) * height}`;
    const runs = [[]];
    values.forEach((value, n) => Number.isFinite(value) ? runs.at(-1).push(point(value, n)) : runs.push([]));
    const lines = runs.filter(run => run.length > 1).map(run => shape('polyline', { points: run.join(' ') }));
    const x = 600 * this.index / last;
    element('series-plot').replaceChildren(...lines, shape('line', { x1: x, x2: x, y1: 0, y2: 200 }));
    element('series-name').textContent = known.length ? `${name}: ${shortNumber(low)} to ${shortNumber(high)}` : `${name}: no value`;
    element('series').hidden = false;
  }

  save() {
    const frame = String(this.pictures[this.index].frame).padStart(4, '0');
    element('picture').toBlob(blob => download(blob, `picture_${frame}.png`));
  }
}

function download(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Says what went wrong. A picture that nobody wants any more is no problem.
function problem(error) {
  if (error.name !== 'AbortError' && error.constructor.name !== 'Stale') element('readout').textContent = `Cannot do this: ${error.message}`;
}

// Round values within the range, no more than about seven.
function ticks(scale) {
  const [low, high] = scale.range;
  if (!(high > low)) return [low];
  if (scale.log && high / low >= 100) {
    const first = Math.ceil(Math.log10(low)), count = Math.floor(Math.log10(high)) - first + 1, every = Math.ceil(count / 7);
    return Array.from({ length: Math.ceil(count / every) }, (_, n) => 10 ** (first + n * every));
  }
  const rough = (high - low) / 6, unit = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(n => n * unit).find(step => step >= rough);
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, n) => (first + n) * step);
}

// An SVG element.
function shape(name, attributes) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  return made;
}
