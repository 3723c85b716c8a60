// Shows the pictures of a source: their colours, what lies under the pointer, and plots over time.
//
// A source has `sequences`, lists of pictures with their view and frame; `about`, a first description of them; and
// `pictures(sequence, index, isPlaying)`, which gives pictures of a frame, each better than the one before: its planes, its own description, and
// the RGBA bytes behind it.

const element = id => document.getElementById(id);

// A number with four digits; with a power of ten if it is very large or small.
function shortNumber(number) {
  const size = Math.abs(number), isPlain = size === 0 || (size >= 1e-3 && size < 1e5);
  return isPlain ? String(Number(number.toPrecision(4))) : Number(number.toPrecision(4)).toExponential().replace('e+', 'e');
}

const DOUBLE = 250; // milliseconds in which a second click makes a double click

// Says something on a line; what does not fit shows as its title.
function say(id, text) {
  element(id).textContent = element(id).title = text;
}

// Whether a key is for the control that has the focus.
function isForControl({ key, target, ctrlKey, metaKey, altKey }) {
  if (ctrlKey || metaKey || altKey || element('text-dialog').open) return true;
  if (target.matches('input[type="range"], input[type="radio"], [role="slider"]')) return /^(Arrow|Page|Home$|End$)/.test(key);
  return target.matches('input, select, textarea') || (target.matches('button, summary') && [' ', 'Enter'].includes(key));
}

class Player {
  constructor(source) {
    this.source = source;
    this.chosen = { map: null }; // the map that was chosen, and the range, the logarithm and gamma of each kind of picture
    this.sequence = 0;
    this.index = source.opening;
    this.shown = null;
    this.context = element('picture').getContext('2d');
    this.bar = new Bar((range, isMoving) => this.setRange(range, isMoving));
    this.time = new TimeLine(this);
    element('sequence').replaceChildren(...source.sequences.map(({ label }, n) => new Option(label, n)));
    element('views').hidden = source.sequences.length < 2;
    this.restore();
    this.adopt(source.about);
    this.beginTime();
    this.listen();
    const hasControls = this.source.look || !element('colours').hidden;
    this.fold(!hasControls || window.matchMedia('(max-width: 50rem)').matches);
    element('link').hidden = location.protocol === 'about:'; // a page within another has no address
  }

  // Takes up the state of the address.
  restore() {
    const { mode, sequence, frame, map, range, log, gamma } = Address.read(), { maps, mode: first } = this.source.about;
    this.sequence = clamped(natural(sequence) ?? 0, 0, this.source.sequences.length - 1);
    const index = this.pictures.findIndex(picture => picture.frame === natural(frame));
    if (index >= 0) this.index = index;
    if (Object.hasOwn(maps, map ?? '')) this.chosen.map = map;
    const ends = numbersIn(range, 2), [bent] = numbersIn(gamma, 1) ?? [];
    this.chosen[`of ${mode ?? this.source.firstMode ?? first}`] = {
      ...(ends && ends[0] < ends[1] ? { range: ends } : {}), ...(log ? { isLog: log === '1' } : {}), ...(bent ? { gamma: clamped(bent, -1, 1) } : {}),
    };
  }

  // What the address keeps.
  get state() {
    const { look, lacksErrors } = this.source, mode = look?.mode === 'error' && lacksErrors ? 'mean' : look?.mode ?? this.about.mode;
    const { range, isLog, gamma } = this.chosen[`of ${mode}`] ?? {}, { frame } = this.pictures[this.index];
    return {
      frame, sequence: this.sequence || null, map: this.chosen.map, range: range?.join() ?? null, log: isLog === undefined ? null : Number(isLog),
      gamma: Number(gamma) || null,
    };
  }

  get pictures() { return this.source.sequences[this.sequence].pictures; }

  // Follows the description of pictures. Colours that the user did not choose follow, too.
  adopt(about) {
    const isOther = about.mode !== this.about?.mode || about.kind !== this.about?.kind;
    this.about = about;
    document.documentElement.classList.toggle('light', about.background[1] > 127);
    document.title = element('title').textContent = about.title || about.values || 'wavesplat';
    element('provenance').textContent = JSON.stringify(about.settings, null, 1);
    const picture = element('picture');
    picture.ariaLabel = `${about.mode || 'picture'} of ${about.values || about.title || 'values'}`;
    if (picture.width !== about.size[0] || picture.height !== about.size[1] || !this.image) {
      [picture.width, picture.height] = about.size;
      this.image = this.context.createImageData(...about.size);
      this.image.data.fill(255);
    }
    if (isOther) this.beginColours();
    if (about.kind === 'light') element('map').value = about.map;
    this.takeColours();
  }

  beginColours() {
    const { about } = this, isOfValues = about.kind === 'value';
    if (!this.source.look) element('bar').hidden = !isOfValues && !about.hasBar; // a live page hides it as soon as a mode is chosen
    element('colours').hidden = !isOfValues && about.mode !== 'composite';
    element('bar').classList.toggle('fixed', element('colours').hidden);
    element('log-control').hidden = element('gamma-control').hidden = !isOfValues;
    element('map').replaceChildren(...Object.keys(about.maps).map(name => new Option(name)));
    element('bar-name').textContent = about.values;
    const { map } = this.chosen, { isLog = about.log, gamma = 0 } = this.ownColours;
    element('map').value = isOfValues && map in about.maps ? map : about.map;
    element('log').checked = isLog;
    element('gamma').value = gamma;
  }

  // The user's choices for pictures of this kind.
  get ownColours() { return this.chosen[`of ${this.about.mode}`] ??= {}; }

  // The range: as chosen, or that of the pictures, with 0 in the middle of a map that diverges from it.
  takeColours() {
    const { about, range: before } = this, map = element('map').value, { range } = this.ownColours;
    const automatic = map === about.map ? about.range : suitable(about.range, map);
    if (about.kind === 'value' || !range) this.ownColours.automatic = automatic;
    this.range = range ?? automatic;
    if (this.range.some((end, n) => end !== before?.[n])) this.showRange(); // else what is typed stays
    this.recolour();
  }

  showRange() {
    [element('low').value, element('high').value] = this.range.map(shortNumber);
    this.markRange('');
  }

  // Says what is wrong with the range that is typed, if anything is.
  markRange(wrong) {
    for (const id of ['low', 'high']) element(id).setCustomValidity(wrong);
    if (wrong) say('readout', wrong);
  }

  resetColours() {
    delete this.chosen[`of ${this.about.mode}`];
    this.chosen.map = null;
    this.beginColours();
    this.takeColours();
    this.showRange();
    this.keep();
  }

  chooseMap() {
    this.chosen.map = element('map').value;
    this.takeColours();
    this.keep();
  }

  // Keeps the state in the address.
  keep() {
    Address.write({ ...this.state, ...this.source.state });
  }

  // Folds the controls away, or back.
  fold(isFolded = !document.documentElement.classList.contains('folded')) {
    document.documentElement.classList.toggle('folded', isFolded);
    element('fold').ariaExpanded = !isFolded;
  }

  beginTime() {
    this.index = Math.min(this.index, this.pictures.length - 1);
    element('sequence').value = this.sequence;
    this.time.begin();
  }

  listen() {
    const on = (id, event, action) => element(id).addEventListener(event, action);
    on('sequence', 'change', () => this.choose(Number(element('sequence').value)));
    on('map', 'input', () => this.chooseMap());
    on('log', 'input', () => { this.ownColours.isLog = element('log').checked; this.recolour(); this.keep(); });
    on('gamma', 'input', () => { this.ownColours.gamma = element('gamma').value; this.recolour(); this.keep(); });
    for (const id of ['low', 'high']) on(id, 'change', () => this.chooseRange());
    on('reset', 'click', () => { this.resetColours(); this.source.reset?.(); });
    on('save', 'click', () => this.save());
    on('link', 'click', () => offer('Link to this page', Address.link()));
    on('fold', 'click', () => this.fold());
    on('close-series', 'click', () => this.clearSeries());
    on('picture', 'pointermove', event => this.read(event));
    on('picture', 'pointerleave', () => { this.pointer = null; say('readout', ''); });
    on('picture', 'click', event => this.click(event));
    document.addEventListener('keydown', event => this.key(event));
  }

  key(event) {
    if (isForControl(event)) return;
    const last = this.pictures.length - 1;
    const actions = {
      ' ': () => event.repeat || this.time.play(!this.time.isPlaying),
      ArrowRight: () => this.show(Math.min(this.index + 1, last)),
      ArrowLeft: () => this.show(Math.max(this.index - 1, 0)),
      Home: () => this.show(0),
      End: () => this.show(last),
      c: () => this.fold(),
      v: () => this.choose((this.sequence + 1) % this.source.sequences.length),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  choose(sequence) {
    this.sequence = sequence;
    this.clearSeries();
    this.beginTime();
    this.show();
  }

  // Takes the range that is typed, as soon as it is in order: its other end may follow.
  chooseRange() {
    const ends = ['low', 'high'].map(element), number = (end, n) => end.value === shortNumber(this.range[n]) ? this.range[n] : end.valueAsNumber;
    ends.filter(end => !Number.isFinite(end.valueAsNumber)).forEach(end => { end.value = shortNumber(this.range[ends.indexOf(end)]); });
    const range = ends.map(number);
    if (range[0] >= range[1]) return this.markRange('From must be below To: change the other one as well.');
    this.setRange(range, false);
  }

  // Takes a range. While it moves, more of them follow.
  setRange(range, isMoving) {
    this.ownColours.range = range;
    this.takeColours();
    this.showRange();
    this.source.ranged?.(range, isMoving);
    if (!isMoving) this.keep();
  }

  // Makes the colours anew, and draws with them.
  recolour() {
    const { about } = this, log = element('log');
    log.disabled = this.range[0] <= 0;
    element('log-control').title = log.disabled ? 'A logarithm needs a range above 0: raise From' : '';
    const table = tableOf(about.maps[element('map').value]), gamma = 2 ** -element('gamma').value;
    this.scale = new Scale({ table, range: this.range, log: log.checked, gamma, clear: this.clear() });
    this.drawBar();
    this.draw();
  }

  // The values of empty space, which fade over a share of the range.
  clear() {
    const { range: [low, high], clear } = this.about, [least, most] = this.range;
    return clear && [clear[0], clear[1], high > low ? clear[2] * (most - least) / (high - low) : clear[2]];
  }

  drawBar() {
    this.bar.show(this.scale, this.ownColours.automatic ?? this.range, (values, pixels) => {
      paint([values], 'value', this.scale, this.plainBackground(values.length), pixels);
    });
  }

  plainBackground(pixels) {
    const rgba = new Uint8ClampedArray(4 * pixels);
    for (let i = 0; i < rgba.length; i++) rgba[i] = i % 4 < 3 ? this.about.background[i % 4] : 255;
    return rgba;
  }

  // Shows a frame: what is there at once, and then better pictures of it. Only the last request counts.
  async show(index = this.index) {
    this.index = index;
    const asked = [this.sequence, index], isAsked = () => asked[0] === this.sequence && asked[1] === this.index;
    this.time.follow(index);
    this.keep();
    try {
      for await (const shown of this.source.pictures(...asked, this.time.isPlaying)) {
        if (!isAsked()) return;
        this.take(shown);
      }
    } catch (error) { problem(error); }
  }

  take(shown) {
    this.shown = shown;
    if (shown.about === this.about) this.draw();
    else this.adopt(shown.about);
    this.source.drawn?.(shown);
    this.time.showLoaded(this.source.loaded());
    if (this.pointer) this.read(this.pointer);
    if (this.series) this.drawSeries(this.series.values, this.series.name);
  }

  draw() {
    const { planes, backdrop, shares, about } = this.shown ?? {};
    if (!planes || planes[0].length * 4 !== this.image.data.length) return;
    const painted = about.kind === 'value' && !this.scale.log ? [weighed(planes[0], shares, about.beyond)] : planes;
    paint(painted, about.kind, this.scale, backdrop ?? this.plainBackground(planes[0].length), this.image.data);
    this.context.putImageData(this.image, 0, 0);
    if (about.kind === 'value') this.bar.showCounts(countsOf(painted[0], this.bar.domain));
    document.documentElement.dataset.drawn = `${this.sequence}:${this.index}`;
  }

  // The pixel under the pointer, in a picture of this size.
  pixel(event, [width, height] = this.about.size) {
    const box = element('picture').getBoundingClientRect(), scale = Math.min(box.width / width, box.height / height);
    const at = (pointer, start, length, pixels) => Math.floor((pointer - start - (length - pixels * scale) / 2) / scale);
    const x = at(event.clientX, box.left, box.width, width), y = at(event.clientY, box.top, box.height, height);
    return x >= 0 && y >= 0 && x < width && y < height ? { x, y, i: y * width + x } : null;
  }

  read(event) {
    this.pointer = event;
    const at = this.pixel(event), { about } = this;
    if (!at || !this.shown) return;
    const { planes: [values], beneath } = this.shown, value = values[at.i];
    const text = Number.isNaN(value) ? 'no value' : `${shortNumber(value)}${about.values ? `  ${about.values}` : ''}`;
    const of = beneath ? `, value ${shortNumber(beneath[at.i])},` : '';
    const place = this.source.place?.(event) ?? `pixel ${at.x}, ${at.y}`, time = element('label').textContent;
    say('readout', `${about.kind === 'value' ? `${text}${of} at ` : ''}${place}, ${time}`);
  }

  // Plots what was clicked, unless another click makes it a double click.
  click(event) {
    clearTimeout(this.clicked);
    if (event.detail > 1 || this.source.wasDragged?.()) return;
    this.clicked = setTimeout(() => this.plot(event).catch(problem), DOUBLE);
  }

  // Plots the values of a pixel over time.
  async plot(event) {
    const { sequence, index } = this, values = [];
    if (!this.shown || this.pictures.length < 2) return;
    this.clearSeries();
    if (this.about.kind !== 'value') return say('readout', 'These pixels have colours and no values, so nothing is plotted.');
    const plotted = this.plotted = {}, isWanted = () => this.plotted === plotted;
    const { about, planes: [now] } = await this.source.whole(sequence, index, isWanted), at = this.pixel(event, about.size);
    if (!at || Number.isNaN(now[at.i])) return say('readout', 'There is no value here, so nothing is plotted.');
    if (await this.source.plot?.(event, isWanted)) return;
    for (let n = 0; n < this.pictures.length && isWanted(); n++) {
      values.push((await this.source.whole(sequence, n, isWanted)).planes[0][at.i]);
    }
    if (isWanted()) this.drawSeries(values, `${about.values || 'Values'} at pixel ${at.x}, ${at.y}`);
  }

  // Forgets a series, for its pixel shows something else now.
  clearSeries() {
    this.series = this.plotted = null;
    clearTimeout(this.clicked);
    element('series').hidden = true;
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

  // Saves the picture with its colours and time.
  save() {
    const frame = String(this.pictures[this.index].frame).padStart(4, '0');
    this.withLegend().toBlob(blob => download(blob, `picture_${frame}.png`));
  }

  // The picture, and below it its name, its time, and the colours of its values.
  withLegend() {
    const picture = element('picture'), { width, height } = picture, line = Math.max(14, Math.round(0.025 * Math.min(width, height)));
    const canvas = document.createElement('canvas'), context = canvas.getContext('2d'), hasBar = !element('bar').hidden;
    [canvas.width, canvas.height] = [width, height + (hasBar ? 5 : 2) * line];
    const style = getComputedStyle(document.documentElement);
    context.fillStyle = `rgb(${this.about.background.join()})`;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(picture, 0, 0);
    context.font = `${line}px system-ui, sans-serif`;
    context.fillStyle = style.getPropertyValue('--ink');
    const write = (text, x, y, align) => { context.textAlign = align; context.fillText(text, x, y, width - 2 * line); };
    write(this.about.values || element('title').textContent, line, height + 1.2 * line, 'left');
    if (this.pictures.length > 1) write(element('label').textContent, width - line, height + 1.2 * line, 'right');
    if (!hasBar) return canvas;
    const room = width - 4 * line;
    context.imageSmoothingEnabled = false;
    context.drawImage(element('bar-colours'), 2 * line, height + 2 * line, room, line);
    for (const mark of element('bar-ticks').children) write(mark.textContent, 2 * line + parseFloat(mark.style.left) / 100 * room, height + 4.2 * line, 'center');
    return canvas;
  }
}

function download(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Copies a text, or shows it where a page may not copy.
async function offer(name, text) {
  try {
    await navigator.clipboard.writeText(text);
    say('readout', `Copied: ${text}`);
  } catch {
    say('text-name', name);
    element('text').value = text;
    element('text-dialog').showModal();
    element('text').select();
  }
}

// Whether an error means only that another request came first.
const isPassing = error => error.name === 'AbortError' || error.constructor.name === 'Stale';

// Says what went wrong.
function problem(error) {
  if (!isPassing(error)) say('readout', `Cannot do this: ${error.message}`);
}

// Round values within the range, no more than about seven.
function ticks(scale) {
  const [low, high] = scale.range;
  if (!(high > low)) return [low];
  if (scale.log && high / low >= 100) {
    const first = Math.ceil(Math.log10(low)), count = Math.floor(Math.log10(high)) - first + 1, every = Math.ceil(count / 7);
    return Array.from({ length: Math.ceil(count / every) }, (_, n) => 10 ** (first + n * every));
  }
  const step = roundStep((high - low) / 6);
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, n) => (first + n) * step);
}

// An SVG element.
function shape(name, attributes) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  return made;
}
