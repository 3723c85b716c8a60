// What a user does to the camera and the scene of a live page.

class Steering {
  constructor(player) {
    this.player = player;
    this.live = player.source;
    document.documentElement.classList.add('live');
    Object.assign(this.live, {
      changed: () => player.show(),
      colours: () => this.colours(),
      ranged: range => { if (this.live.look.mode === 'composite') this.live.change({ range }, false); },
      reset: () => { if (this.live.look.mode === 'composite') this.live.change({ range: null }, false); },
      wasDragged: () => this.dragged > 4,
      place: event => this.place(event),
      plot: event => this.plot(event),
    });
    this.pointers = new Map();
    this.listenToPicture();
    this.listenToControls();
  }

  listenToPicture() {
    const picture = element('picture'), on = (event, action) => picture.addEventListener(event, action, { passive: false });
    on('pointerdown', event => { this.pointers.set(event.pointerId, event); picture.setPointerCapture(event.pointerId); this.dragged = 0; });
    on('pointermove', event => this.drag(event));
    for (const end of ['pointerup', 'pointercancel']) on(end, event => this.pointers.delete(event.pointerId));
    on('wheel', event => { event.preventDefault(); this.zoom(1.0015 ** -event.deltaY, event); });
    on('dblclick', () => this.live.change(this.live.home(), false));
    on('contextmenu', event => event.preventDefault());
    document.addEventListener('keydown', event => this.key(event));
    window.addEventListener('resize', () => this.live.change({}, false));
  }

  // World units of a pixel on the screen.
  unit() {
    const box = element('picture').getBoundingClientRect();
    return 2 * this.live.facts.radius / (this.live.look.zoom * 0.95 * Math.min(box.width, box.height));
  }

  // The world point under the pointer, on the slice that is nearest to the eye; null where none is.
  point({ clientX, clientY }) {
    const { mode, slices, center, view } = this.live.look, { origin, spacing, dims } = this.live.facts;
    if (mode !== 'slice') return null;
    const box = element('picture').getBoundingClientRect(), unit = this.unit(), near = nearness(view);
    const away = [clientX - box.left - box.width / 2, box.top + box.height / 2 - clientY].map(pixels => pixels * unit);
    const middle = beside(center, view, away), ends = axis => [origin[axis], origin[axis] + spacing[axis] * (dims[axis] - 1)];
    const isWithin = (at, axis) => ends(axis)[0] - spacing[axis] / 2 <= at && at <= ends(axis)[1] + spacing[axis] / 2;
    const met = slices.map(([name, share]) => {
      const axis = 'xyz'.indexOf(name), [low, high] = ends(axis), depth = (low + share * (high - low) - middle[axis]) / near[axis];
      return { depth, at: middle.map((place, other) => place + depth * near[other]) };
    });
    const inside = met.filter(({ depth, at }) => Number.isFinite(depth) && at.every(isWithin));
    return inside.sort((a, b) => b.depth - a.depth)[0]?.at ?? null;
  }

  place(event) {
    const point = this.point(event), { origin, spacing, axes } = this.live.facts;
    return point && axes.map(({ name, unit, at }, n) => {
      const voxel = Math.min(Math.max((point[n] - origin[n]) / spacing[n], 0), at.length - 1), below = Math.floor(voxel);
      const value = at[below] + (voxel - below) * ((at[below + 1] ?? at[below]) - at[below]);
      return `${name} ${shortNumber(value)}${unit && ` ${unit}`}`;
    }).join(', ');
  }

  // Plots the series of a point of a slice, from the file.
  async plot(event) {
    const point = this.point(event), { origin, spacing, dims } = this.live.facts;
    if (!point) return false;
    const share = point.map((at, axis) => dims[axis] > 1 ? Math.min(Math.max((at - origin[axis]) / (spacing[axis] * (dims[axis] - 1)), 0), 1) : 0);
    const answer = await fetch('series', { method: 'POST', body: JSON.stringify(share) });
    if (!answer.ok) return false; // frames have no series of their own: the pixel's is plotted
    const lines = (await answer.text()).trim().split('\n').slice(1);
    this.player.drawSeries(lines.map(line => Number(line.split(',').at(-1) || NaN)), `${this.live.facts.values || 'Values'} at ${this.place(event)}`);
    return true;
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    this.pointers.set(event.pointerId, event);
    const by = [event.clientX - before.clientX, event.clientY - before.clientY];
    this.dragged += Math.hypot(...by);
    if (this.dragged <= 4) return;
    if (this.pointers.size === 2) return this.pinch(event, before);
    const isMove = event.shiftKey || event.buttons === 2;
    const { view, center } = this.live.look, height = element('picture').getBoundingClientRect().height;
    const moved = () => beside(center, view, [-by[0] * this.unit(), by[1] * this.unit()]);
    this.live.change(isMove ? { center: moved() } : { view: turned(view, by, height) }, true);
    element('side').value = 'free';
  }

  // Two fingers zoom by the change of their distance.
  pinch(event, before) {
    const other = [...this.pointers.values()].find(pointer => pointer.pointerId !== event.pointerId);
    const apart = ({ clientX, clientY }) => Math.hypot(clientX - other.clientX, clientY - other.clientY);
    this.zoom(apart(event) / Math.max(apart(before), 1), { clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2 });
  }

  // Zooms so that what is under the pointer stays there.
  zoom(factor, { clientX, clientY }) {
    const { zoom, center, view } = this.live.look, box = element('picture').getBoundingClientRect();
    const next = Math.min(Math.max(zoom * factor, 0.05), 500), unit = this.unit(), part = 1 - zoom / next;
    const away = [clientX - box.left - box.width / 2, box.top + box.height / 2 - clientY];
    this.live.change({ zoom: next, center: beside(center, view, away.map(pixels => pixels * unit * part)) }, true);
  }

  key(event) {
    if (event.target.matches('input, select, textarea') || event.ctrlKey || event.metaKey || event.altKey) return;
    const box = element('picture').getBoundingClientRect(), middle = { clientX: box.left + box.width / 2, clientY: box.top + box.height / 2 };
    const turn = by => this.live.change({ view: turned(this.live.look.view, by, box.height) }, true);
    const actions = {
      '+': () => this.zoom(1.2, middle), '-': () => this.zoom(1 / 1.2, middle), 0: () => this.live.change(this.live.home(), false),
      a: () => turn([-20, 0]), d: () => turn([20, 0]), w: () => turn([0, 20]), s: () => turn([0, -20]),
    };
    actions[event.key]?.();
  }

  listenToControls() {
    const on = (id, event, action) => element(id).addEventListener(event, action);
    element('side').replaceChildren(...Object.keys(SIDES).map(name => new Option(name)));
    element('side').value = 'free';
    on('side', 'change', () => this.live.change({ view: SIDES[element('side').value] ?? this.live.look.view }, false));
    for (const id of ['mode', 'shade', 'around', 'white']) on(id, 'change', () => this.choose(false));
    for (const axis of 'xyz') {
      on(`slice-${axis}`, 'change', () => this.choose(false));
      on(`place-${axis}`, 'input', () => { element(`slice-${axis}`).checked = true; this.choose(true); });
    }
    on('iso', 'input', () => this.choose(true));
    on('map', 'input', () => { if (element('mode').value === 'composite') this.choose(false); });
    on('copy', 'click', () => this.copy());
    on('save-page', 'click', () => this.save('page.html'));
    on('save-movie', 'click', () => this.save('movie.mp4'));
    this.opacity = new OpacityEditor(points => this.live.change({ opacity: points }, true));
  }

  // Shows what the controls say.
  choose(isMoving) {
    const mode = element('mode').value, [low, high] = this.live.facts.range ?? this.live.about.range;
    const iso = Number((low + element('iso').valueAsNumber * (high - low)).toPrecision(4));
    const slices = [...'xyz'].filter(axis => element(`slice-${axis}`).checked).map(axis => [axis, element(`place-${axis}`).valueAsNumber]);
    element('iso-control').hidden = mode !== 'iso';
    element('slice-control').hidden = mode !== 'slice';
    element('shade-control').hidden = element('opacity-editor').hidden = mode !== 'composite';
    element('iso-value').textContent = shortNumber(iso);
    if (mode === 'composite') this.opacity.open();
    const changes = { mode, iso: mode === 'iso' ? [iso] : [], slices: mode === 'slice' ? slices : [], shade: element('shade').checked };
    if (mode === 'slice' && !slices.length) return;
    const isComposite = mode === 'composite', map = isComposite ? element('map').value : undefined;
    const range = isComposite ? this.live.look.range : null;
    this.live.change({ ...changes, map, range, annotate: element('around').checked, light: element('white').checked }, isMoving);
  }

  // The colours of the page, for a picture made elsewhere.
  colours() {
    const { about, range, scale } = this.player;
    return about.kind === 'value' && !this.player.shown?.beneath ? { range, log: scale.log, map: element('map').value } : {};
  }

  async copy() {
    try {
      const text = await (await this.live.made('command', 'picture.png')).text();
      await navigator.clipboard.writeText(text);
      element('readout').textContent = `Copied: ${text}`;
    } catch (error) { problem(error); }
  }

  async save(file) {
    try {
      download(await (await this.live.made('save', file)).blob(), file);
      element('readout').textContent = `Saved ${file}`;
    } catch (error) { problem(error); }
  }
}

// Points of opacity over shares of the range, in front of how common values are.
class OpacityEditor {
  constructor(changed) {
    this.changed = changed;
    this.points = [[0, 0], [1, 0.6]];
    const plot = element('opacity');
    plot.addEventListener('pointerdown', event => { this.held = event.target.tagName === 'circle' ? Number(event.target.dataset.n) : null; });
    plot.addEventListener('pointermove', event => { if (this.held != null && event.buttons) this.move(event); });
    plot.addEventListener('pointerup', () => { this.held = null; });
    plot.addEventListener('dblclick', event => this.toggle(event));
    element('opacity-auto').addEventListener('click', () => this.changed(null));
  }

  async open() {
    if (this.isOpen) return;
    this.isOpen = true;
    const answer = await fetch('histogram');
    this.counts = answer.ok ? await answer.json() : [];
    this.draw();
  }

  at({ clientX, clientY }) {
    const box = element('opacity').getBoundingClientRect(), within = share => Number(Math.min(Math.max(share, 0), 1).toFixed(3));
    return [within((clientX - box.left) / box.width), within(1 - (clientY - box.top) / box.height)];
  }

  move(event) {
    const [share, opacity] = this.at(event), n = this.held, last = this.points.length - 1;
    const low = n ? this.points[n - 1][0] + 0.002 : 0, high = n < last ? this.points[n + 1][0] - 0.002 : 1;
    this.points[n] = [n === 0 ? 0 : n === last ? 1 : Math.min(Math.max(share, low), high), opacity];
    this.draw();
    this.changed(this.points.map(point => [...point]));
  }

  toggle(event) {
    const n = event.target.tagName === 'circle' ? Number(event.target.dataset.n) : null, last = this.points.length - 1;
    if (n !== null && n > 0 && n < last) this.points.splice(n, 1);
    if (n === null && this.points.length < 16) this.points = [...this.points, this.at(event)].sort((a, b) => a[0] - b[0]);
    this.draw();
    this.changed(this.points.map(point => [...point]));
  }

  draw() {
    const most = Math.log1p(Math.max(...this.counts, 1)), width = 600 / Math.max(this.counts.length, 1);
    const bars = this.counts.map((count, n) => {
      const height = 100 * Math.log1p(count) / most;
      return shape('rect', { x: n * width, y: 105 - height, width, height });
    });
    const place = ([share, opacity]) => [600 * share, 105 - 100 * opacity];
    const line = shape('polyline', { points: this.points.map(place).join(' ') });
    const dots = this.points.map((point, n) => shape('circle', { cx: place(point)[0], cy: place(point)[1], r: 7, 'data-n': n }));
    element('opacity').replaceChildren(...bars, line, ...dots);
  }
}
