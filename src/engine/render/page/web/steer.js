// The user's control of the camera and the scene of a live page.

const AXES = ['x', 'y', 'z'];
const HELP = ['Drag turns, shift-drag moves, the wheel zooms, a double click resets. W A S D turn, + and - zoom, space plays, arrows step.', 'A finger turns, two zoom and move, a double tap resets.'];

// Pairs in a text like "a:1,b:2".
const pairs = text => (text ?? '').split(',').map(pair => pair.split(':')).filter(pair => pair.length === 2);

const textOf = bytes => new TextDecoder().decode(bytes);

const ZOOM = [0.05, 500];

// What a click does in each mode.
const CLICKS = {
  mean: 'A click plots the pixel over time.', mip: 'A click plots the pixel over time.',
  slice: 'A click plots the point over time.', error: 'A click plots the error of the pixel over time.',
};

class Steering {
  constructor(player) {
    this.player = player;
    this.live = player.source;
    document.documentElement.classList.add('live');
    Object.assign(this.live, {
      changed: () => { this.showSide(); player.show(); },
      moved: () => player.clearSeries(),
      drawn: shown => this.follow(shown),
      colours: () => this.colours(),
      ranged: (range, isMoving) => { if (player.about.mode === 'composite' && this.live.look.mode === 'composite') this.live.change({ range }, isMoving); },
      filled: () => player.time.showLoaded(this.live.loaded()),
      reset: () => { if (this.live.look.mode === 'composite') this.choose(false); },
      wasDragged: () => this.dragged > 4,
      place: event => this.place(event),
      plot: (event, isWanted) => this.plot(event, isWanted),
    });
    this.pointers = new Map();
    this.listenToPicture();
    this.listenToControls();
    this.restore();
    this.choose(false);
  }

  // Takes up the state of the address.
  restore() {
    const { mode, view, center, zoom, iso, slices, opacity, shade, box, white } = Address.read(), share = text => clamped(Number(text) || 0, 0, 1);
    this.mode = this.live.firstMode;
    this.mode = mode; // stays if there is no such mode
    const angles = numbersIn(view, 2), middle = numbersIn(center, 3), [factor] = numbersIn(zoom, 1) ?? [], [place] = numbersIn(iso, 1) ?? [];
    if (angles) this.live.look.view = turned(angles, [0, 0], 1);
    if (middle) this.live.look.center = middle;
    if (factor > 0) this.live.look.zoom = clamped(factor, ...ZOOM);
    if (place !== undefined) [element('iso').value, this.isIsoChosen] = [share(place), true];
    const known = pairs(slices).filter(([axis]) => AXES.includes(axis)), chosen = known.length ? known : [['z', 0.5]];
    AXES.forEach(axis => { [element(`slice-${axis}`).checked, element(`place-${axis}`).value] = [false, 0.5]; });
    for (const [axis, at] of chosen) [element(`slice-${axis}`).checked, element(`place-${axis}`).value] = [true, share(at)];
    const points = pairs(opacity).map(point => point.map(Number)).filter(point => point.every(n => n >= 0 && n <= 1));
    const isInOrder = points.every(([at], n) => n === 0 ? at === 0 : at > points[n - 1][0]) && points.at(-1)?.[0] === 1;
    if (isInOrder && points.length <= MOST_POINTS) this.live.look.opacity = points;
    [element('shade').checked, element('around').checked, element('white').checked] = [shade === '1', box !== '0', white === '1'];
  }

  // The mode that is chosen.
  get mode() { return document.querySelector('[name="mode"]:checked').value; }

  set mode(mode) {
    const tile = Array.from(document.querySelectorAll('[name="mode"]')).find(tile => tile.value === mode);
    if (tile) tile.checked = true;
  }

  listenToPicture() {
    const picture = element('picture'), on = (event, action) => picture.addEventListener(event, action, { passive: false });
    on('pointerdown', event => { this.pointers.set(event.pointerId, event); picture.setPointerCapture(event.pointerId); this.dragged = 0; });
    on('pointermove', event => this.drag(event));
    for (const end of ['pointerup', 'pointercancel']) on(end, event => { this.pointers.delete(event.pointerId); if (!this.pointers.size) this.live.rest(); });
    on('wheel', event => { event.preventDefault(); this.zoom(1.0015 ** -event.deltaY, event); });
    on('dblclick', () => this.live.change(this.live.home(), false));
    on('contextmenu', event => event.preventDefault());
    document.addEventListener('keydown', event => this.key(event));
    this.size = this.sizes;
    new ResizeObserver(() => this.resize()).observe(element('frame-of-picture'));
  }

  get sizes() { return `${this.live.fullSize()} ${this.live.screenSize(SHARP_PIXELS)}`; }

  // Asks for pictures that fill their place.
  resize() {
    if (this.sizes === this.size) return;
    this.size = this.sizes;
    this.live.change({}, false);
  }

  // World units of a pixel on the screen.
  unit() {
    const box = element('picture').getBoundingClientRect();
    return 1 / this.live.scaleIn([box.width, box.height]);
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
    return point && axes.map(({ name }, n) => `${name} ${this.coordinate(n, (point[n] - origin[n]) / spacing[n])}`).join(', ');
  }

  // The coordinate of a voxel, or of a place between two, with its unit.
  coordinate(axis, voxel) {
    const { unit, at } = this.live.facts.axes[axis], within = clamped(voxel, 0, at.length - 1), below = Math.floor(within);
    const value = at[below] + (within - below) * ((at[below + 1] ?? at[below]) - at[below]);
    return `${shortNumber(value)}${unit && ` ${unit}`}`;
  }

  // Plots the series of a point of a slice, from the file.
  async plot(event, isWanted) {
    const point = this.point(event), { origin, spacing, dims } = this.live.facts, place = this.place(event);
    if (!point) return false;
    const share = point.map((at, axis) => dims[axis] > 1 ? clamped((at - origin[axis]) / (spacing[axis] * (dims[axis] - 1)), 0, 1) : 0);
    const answer = await this.live.engine.ask('series', share).catch(error => { if (this.live.facts.file) throw error; });
    if (!answer) return false; // frames have no series of their own: the pixel's is plotted
    if (!isWanted()) return true;
    const lines = textOf(answer).trim().split('\n').slice(1);
    this.player.drawSeries(lines.map(line => Number(line.split(',').at(-1) || NaN)), `${this.live.facts.values || 'Values'} at ${place}`);
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
  }

  // Two fingers zoom by the change of their distance, and move by that of their middle.
  pinch(event, before) {
    const other = [...this.pointers.values()].find(pointer => pointer.pointerId !== event.pointerId);
    const apart = ({ clientX, clientY }) => Math.hypot(clientX - other.clientX, clientY - other.clientY);
    const { center, view } = this.live.look, by = [before.clientX - event.clientX, event.clientY - before.clientY];
    this.live.look.center = beside(center, view, by.map(pixels => pixels / 2 * this.unit()));
    this.zoom(apart(event) / Math.max(apart(before), 1), { clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2 });
  }

  // Zooms so that what is under the pointer stays there.
  zoom(factor, { clientX, clientY }) {
    const { zoom, center, view } = this.live.look, box = element('picture').getBoundingClientRect();
    const next = clamped(zoom * factor, ...ZOOM), unit = this.unit(), part = 1 - zoom / next;
    const away = [clientX - box.left - box.width / 2, box.top + box.height / 2 - clientY];
    this.live.change({ zoom: next, center: beside(center, view, away.map(pixels => pixels * unit * part)) }, true);
  }

  key(event) {
    if (isForControl(event)) return;
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
    on('side', 'change', () => this.live.change({ view: SIDES[element('side').value] ?? this.live.look.view }, false));
    this.showSide();
    for (const tile of document.querySelectorAll('[name="mode"]')) tile.addEventListener('change', () => this.choose(false));
    for (const id of ['shade', 'around', 'white']) on(id, 'change', () => this.choose(false));
    for (const [n, axis] of AXES.entries()) {
      say(`name-${axis}`, this.live.facts.axes[n].name);
      element(`place-${axis}`).ariaLabel = `place along ${this.live.facts.axes[n].name}`;
      on(`slice-${axis}`, 'change', () => this.choose(false));
      on(`place-${axis}`, 'input', () => { element(`slice-${axis}`).checked = true; this.choose(true); });
    }
    element('save-movie').hidden = Boolean(this.live.facts.file); // ffmpeg makes movies
    on('iso', 'input', () => { this.isIsoChosen = true; this.choose(true); });
    on('map', 'input', () => { if (this.mode === 'composite') this.choose(false); });
    on('copy', 'click', () => this.copy());
    on('save-page', 'click', () => this.save('page.html'));
    on('save-movie', 'click', () => this.save('movie.mp4'));
    on('opacity-auto', 'click', () => this.live.change({ opacity: null }, false));
    this.player.bar.opaque = points => this.live.change({ opacity: points }, true);
    say('help', HELP[Number(window.matchMedia('(pointer: coarse)').matches)]);
  }

  // Offers the archives of the page, if there are several.
  offerArchives(titles, chosen) {
    element('archives').hidden = titles.length < 2;
    element('archive').replaceChildren(...titles.map(title => new Option(title)));
    element('archive').value = chosen;
    element('archive').addEventListener('change', () => { location.hash = `archive=${encodeURIComponent(element('archive').value)}`; });
  }

  // Names the side that is seen, if it has a name.
  showSide() {
    const { view } = this.live.look, named = Object.keys(SIDES).find(name => String(SIDES[name]) === String(view));
    element('side').value = named ?? 'free';
  }

  // Shows the controls of a mode, and what they say.
  showControls(mode) {
    element('iso-control').hidden = mode !== 'iso';
    element('slice-control').hidden = mode !== 'slice';
    element('opacity-control').hidden = mode !== 'composite';
    element('bar').classList.toggle('open', mode === 'composite');
    element('bar').hidden = mode === 'iso' || this.live.kind === 'channels';
    this.size = this.sizes; // the picture has another place now, for which it is asked anyway
    say('help-click', this.player.pictures.length > 1 ? CLICKS[mode] ?? '' : '');
    const ticked = AXES.filter(axis => element(`slice-${axis}`).checked);
    for (const [n, axis] of AXES.entries()) {
      const box = element(`slice-${axis}`);
      box.disabled = ticked.length === 1 && box.checked;
      box.title = box.disabled ? 'One slice stays: tick another one first' : '';
      say(`at-${axis}`, this.coordinate(n, element(`place-${axis}`).valueAsNumber * (this.live.facts.dims[n] - 1)));
    }
    for (const [id, what] of [['save-page', 'page'], ['save-movie', 'movie (by ffmpeg)']]) {
      element(id).disabled = mode === 'error';
      element(id).title = mode === 'error' ? `A ${id.slice(5)} would show the mean and not its error: save the picture` : `Save all frames of this view as a ${what}`;
    }
  }

  // Follows the picture that is drawn. Until one of the chosen mode is there, the old one is dim.
  follow({ about, planes, quality }) {
    const { look } = this.live, { bar } = this.player, isOld = about.mode !== look.mode && (look.mode !== 'error' || quality === COARSE);
    document.documentElement.classList.toggle('old', isOld);
    element('iso-note').hidden = about.mode !== 'iso' || planes[3].some(opacity => opacity > 0.01);
    if (isOld) return;
    element('bar').hidden = this.mode === 'iso' || about.kind === 'channels';
    if (about.mode !== 'composite') return bar.follow(null);
    if (look.opacity) bar.follow(look.opacity, false);
    else if (quality !== COARSE || !bar.points) bar.follow(about.opacity, true);
    if (quality !== COARSE) this.showHowCommon();
  }

  // How common samples are, of some frames or of one; nothing if that cannot be said.
  howCommon(of = {}) {
    return this.live.engine.ask('histogram', of).then(bytes => JSON.parse(textOf(bytes))).catch(() => null);
  }

  // Shows how common the samples are behind their opacities.
  async showHowCommon() {
    const { bar } = this.player;
    this.common ??= this.howCommon();
    const common = await this.common;
    if (!common?.range || this.mode !== 'composite') return;
    bar.showCounts(countsOver(bar.domain, common));
  }

  // Shows what the controls say.
  async choose(isMoving) {
    const { mode } = this;
    this.showControls(mode);
    document.documentElement.classList.toggle('old', mode !== this.player.about.mode);
    if (this.common && !await this.common) this.common = null; // asks again
    if (mode === 'iso') await (this.isoRange ??= this.beginIso());
    if (this.mode !== mode) return;
    const slices = AXES.filter(axis => element(`slice-${axis}`).checked).map(axis => [axis, element(`place-${axis}`).valueAsNumber]);
    const changes = { mode, iso: mode === 'iso' ? [await this.iso()] : [], slices: mode === 'slice' ? slices : [], shade: element('shade').checked };
    const isComposite = mode === 'composite', { chosen } = this.player, { maps } = this.live.facts;
    const map = isComposite && chosen.map in maps ? chosen.map : undefined, range = isComposite ? chosen['of composite']?.range ?? null : null;
    this.live.change({ ...changes, map, range, annotate: element('around').checked ? 'box,axes' : undefined, theme: element('white').checked ? 'light' : undefined }, isMoving);
  }

  // The value of the isosurface.
  async iso() {
    const [low, high] = await this.isoRange, iso = rounded(low + element('iso').valueAsNumber * (high - low), high - low);
    say('iso-value', shortNumber(iso));
    this.live.isoShare = element('iso').value;
    return iso;
  }

  // The range of isosurfaces. Begins at one that is in the frame that is seen, unless the user is faster.
  async beginIso() {
    const { index } = this.player, slider = element('iso');
    this.live.halt();
    const range = this.live.facts.range ?? (await this.howCommon())?.range ?? this.live.first.range;
    const { surface } = await this.howCommon({ frame: index }) ?? {};
    if (surface != null && !this.isIsoChosen) slider.value = (surface - range[0]) / (range[1] - range[0]);
    return range;
  }

  // The colours of the page, for a picture made elsewhere.
  colours() {
    const { about, range, scale } = this.player;
    return about.kind === 'value' && !this.player.shown?.beneath ? { range, log: scale.log, map: element('map').value } : {};
  }

  async copy() {
    try {
      await offer('The command that draws this', textOf(await this.live.made('command', 'picture.png')));
    } catch (error) { problem(error); }
  }

  async save(file) {
    try {
      download(new Blob([await this.live.made('save', file)]), file);
      say('readout', `Saved ${file}`);
    } catch (error) { problem(error); }
  }
}
