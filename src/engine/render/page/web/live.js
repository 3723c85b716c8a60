// The source of a page that asks for pictures: a server, or the program in its workers.

const BLOCK_FRAMES = 32, COARSE_FRAMES = 8; // frames of a request
const STEPS = 3; // frames whose coarse pictures are loaded ahead of a step in time
const REST = 250; // milliseconds without a change after which pictures are complete
const IDLE = 40; // milliseconds after a full picture until others are loaded ahead
const PATIENCE = 600; // milliseconds after which a request says how far it is

// Ranks of requests. A request never cancels one of higher rank.
const AHEAD = 0, PLOT = 1, USER = 2;

// Qualities of pictures: the coarse ones come first, and sharp ones fill every pixel of a dense screen.
const COARSE = 'coarse', FULL = 'full', SHARP = 'sharp', QUALITIES = [COARSE, FULL, SHARP];
const FULL_PIXELS = 1280, SHARP_PIXELS = 4096; // most pixels along a side
const DENSER = 1.2; // sharp pictures have this many times as many pixels along a side

// Coarse pictures: the pixels of their longer side, and their level of detail. Each mode takes those that answer in time.
const COARSER = [[288, 1], [288, 2], [192, 2], [128, 3]], FIRST = { composite: 2, iso: 2 }, ELSE = 1;
const LEAST_VOXELS = 24; // along the longest side of a coarse picture's volume
const SOON = 25, LATE = 70; // milliseconds: two quicker answers make the next ones finer, two slower ones coarser
const SLOWEST = 2 * LATE; // the full picture waits for coarse ones of the next frames unless one takes longer
const SMOOTH = 60; // milliseconds that a full picture may take to be played

class Stale extends Error {}

// The parts of an answer: the description of its pictures, their blocks, and one with their errors.
function partsOf(bytes) {
  let at = 4 + new DataView(bytes.buffer).getUint32(0, true);
  const { about, blocks, errors, opacity } = JSON.parse(new TextDecoder().decode(bytes.subarray(4, at)));
  const part = size => bytes.subarray(at, at += size);
  return { about: { ...about, opacity }, blocks: blocks.map(([frames, size]) => [frames, part(size)]), errors: errors && part(errors) };
}

// The place of the first of `count` pixels, `step` apart, in a row of `others` pixels with the same middle.
const firstPlace = (count, others, step) => (0.5 - count / 2) * step + others / 2 - 0.5;

// A square picture in another shape with the same middle, with pixels that are `step` of its own apart. Pixels beyond it repeat its edge.
function cut(planes, side, [width, height], step) {
  const places = count => Int32Array.from({ length: count }, (_, n) => clamped(Math.round(firstPlace(count, side, step) + n * step), 0, side - 1));
  const [across, down] = [places(width), places(height)];
  return planes.map(plane => Float32Array.from({ length: width * height }, (_, n) => plane[down[Math.floor(n / width)] * side + across[n % width]]));
}

// The rays of a picture whose first pixel is `at` that of another one, with pixels that are `step` of those apart.
function seenFrom(ray, at, step) {
  const scaled = vector => vector.map(number => number * step);
  return { ...ray, from: ray.from.map((place, axis) => place + at[0] * ray.right[axis] + at[1] * ray.down[axis]), right: scaled(ray.right), down: scaled(ray.down) };
}

// Numbers with nine digits: a picture of 4096 pixels shows no more.
const short = number => Number(number.toPrecision(9)), texts = numbers => numbers.map(short).join();

const pause = milliseconds => new Promise(next => setTimeout(next, milliseconds));

class Live {
  constructor(facts, engine) {
    this.engine = engine;
    for (const name in facts.maps) facts.maps[name] = bytesOf(facts.maps[name]);
    this.facts = facts;
    this.first = {
      title: facts.title, values: facts.values, size: [1, 1], kind: 'value', background: [0, 0, 0], range: facts.range ?? [0, 1],
      log: false, clear: null, maps: facts.maps, map: 'viridis', fps: 25, labels: facts.labels, settings: {}, mode: '',
    };
    this.about = this.first;
    this.opening = facts.opening;
    this.firstMode = facts.mode === 'projection' ? 'mean' : facts.mode;
    this.sequences = [{ label: '', pictures: facts.labels.map((_, frame) => ({ view: 0, frame })) }];
    this.look = { mode: 'mean', slices: [], iso: [], opacity: null, range: null, shade: false, annotate: 'box,axes', ...this.home() };
    this.known = {}; // automatic colours and opacities of each mode, from its first full answer, or a coarse one until then
    this.coarser = {}; // which coarse pictures each mode takes
    this.pace = {}; // milliseconds that a full picture of each mode takes
    this.lastPace = {}; // and that its last coarse picture took
    this.coarseTime = LATE; // what the last one of all took
    this.kept = new Map(); // pictures of each look, the last one used at the end
    this.turn = Promise.resolve();
    this.underWay = null; // the request that is asked
    this.wanted = 0; // how many requests of the user there were
    this.waiting = 0; // and how many of them wait
    this.isMoving = false;
    const { preview } = facts.file ?? {};
    if (preview) {
      preview.answer = partsOf(bytesOf(preview.answer));
      this.describe(preview.answer.about);
      this.learnColours(`${this.firstMode} `, preview.answer.about, FULL);
    }
  }

  // What the address keeps.
  get state() {
    const { mode, view, center, zoom, slices, opacity, shade, annotate, theme } = this.look, home = this.home();
    const unless = (value, first) => String(value) === String(first) ? null : String(value);
    return {
      archive: this.archive, mode: unless(mode, this.firstMode), view: unless(view, home.view), center: unless(texts(center), texts(home.center)), zoom: unless(short(zoom), 1),
      iso: mode === 'iso' ? this.isoShare : null, slices: mode === 'slice' ? slices.map(([axis, share]) => `${axis}:${short(share)}`).join() : null,
      opacity: opacity?.map(point => point.join(':')).join(), shade: shade ? 1 : null, box: annotate ? null : 0, white: theme ? 1 : null,
    };
  }

  home() { return { view: [30, 30], center: this.facts.center, zoom: 1 }; }

  // Pixels of a world unit: all of the volume shows, and the names of its axes in narrow pictures.
  scaleIn([width, height]) { return this.look.zoom * Math.min(0.95 * height, 0.76 * width) / (2 * this.facts.radius); }

  // Pixels of a picture that fills its place on the screen, up to a number along a side.
  screenSize(mostPixels) {
    const { clientWidth, clientHeight } = element('frame-of-picture'), room = [clientWidth, clientHeight].map(side => Math.max(side, 120));
    const density = window.devicePixelRatio || 1, most = Math.min(density, mostPixels / Math.max(...room));
    return room.map(side => Math.round(side * most));
  }

  fullSize() { return this.screenSize(FULL_PIXELS); }

  rung(mode) { return this.coarser[mode] ?? FIRST[mode] ?? ELSE; }

  // Width and height of a picture, and its level of detail.
  measures(quality) {
    if (quality !== COARSE) return { size: quality === SHARP ? this.screenSize(SHARP_PIXELS) : this.fullSize(), lod: 0 };
    const [pixels, lod] = COARSER[this.rung(this.look.mode)], full = this.fullSize(), part = Math.min(1, pixels / Math.max(...full));
    const most = Math.max(0, Math.floor(Math.log2(Math.max(...this.facts.dims) / LEAST_VOXELS)));
    return { size: full.map(side => Math.max(1, Math.round(side * part))), lod: Math.min(this.facts.coarsest, lod, most) };
  }

  // The request for the pictures of some frames: fields of a PictureRequest, as the texts of its options.
  request(frames, quality, chosen = {}) {
    const { mode, view, center, map, range, opacity, slices, iso, shade, annotate, theme } = this.look, { size, lod } = this.measures(quality);
    const isOfErrors = mode === 'error', isComposite = mode === 'composite', known = this.known[this.colourKey(quality)];
    const automatic = known && (known.isFull || quality === COARSE) ? known : {};
    const colours = { map, ...automatic, ...(isComposite && range ? { range } : {}), ...chosen };
    const points = opacity ?? (quality === COARSE && !range ? automatic.opacity : null);
    const look = {
      mode: isOfErrors || mode === 'mean' ? undefined : mode, view: [view.join()], center: texts(center), size: size.join('x'),
      scale: short(this.scaleIn(size)), lod: lod || undefined, frames: frames?.join(':'),
      shade: isComposite && shade, opacity: isComposite ? points?.map(point => point.join(':')).join() : undefined,
      iso: iso.length ? iso.join() : undefined, slice: slices.length ? slices.map(([axis, share]) => `${axis}=${short(100 * share)}%`) : undefined,
      annotate, theme, ...this.coloursOf(mode, colours),
    };
    return { look, certify: isOfErrors && quality !== COARSE, packed: this.engine.isSlow };
  }

  // The fields of a PictureRequest for colours.
  coloursOf(mode, { map, range, log, clear, beyond }) {
    const ofSamples = mode === 'composite' || mode === 'iso', isClear = clear && !ofSamples && mode !== 'slice';
    return {
      [ofSamples ? 'transfer_function' : 'colormap']: map, range: range ? texts(range) : undefined, norm: log && !ofSamples ? 'log' : undefined,
      clear: isClear ? clear.length === 2 ? texts(clear) : 'none' : undefined,
      beyond: beyond === undefined || ofSamples || mode === 'slice' || mode === 'mip' ? undefined : beyond === null ? 'none' : short(beyond),
    };
  }

  // A key for all pictures that share automatic colours. Slices get the colours of their places as soon as they rest.
  colourKey(quality) {
    const { mode, map, slices } = this.look;
    if (mode !== 'slice') return `${mode === 'error' ? 'mean' : mode} ${map ?? ''}`;
    const own = `slice ${JSON.stringify(slices)}`;
    return quality !== COARSE || this.known[own] ? own : this.ofSlices ?? own;
  }

  // A key for all requests that differ only in the frame.
  key(quality) {
    const isChosen = this.look.mode === 'composite' && this.look.range;
    const { look, certify } = this.request(null, quality);
    const automatic = { ...(isChosen ? {} : { range: null }), clear: null, beyond: null, ...(this.look.opacity ? {} : { opacity: null }) };
    return JSON.stringify({ ...look, ...automatic, certify, colours: this.colourKey(quality) });
  }

  found(quality, index) { return this.kept.get(this.key(quality))?.get(index); }

  // Tells which frames have full pictures.
  loaded() {
    const kept = this.kept.get(this.key(FULL));
    return index => kept?.has(index);
  }

  // The qualities to ask for, one after another, unless better ones are there already.
  qualities(isPlaying) {
    if (this.isMoving) return [COARSE];
    if (this.look.mode === 'error') return [FULL];
    if (isPlaying) return [this.pace[this.look.mode] <= SMOOTH ? FULL : COARSE];
    const isDense = !this.isTooSharp && this.screenSize(SHARP_PIXELS)[0] > DENSER * this.fullSize()[0];
    return [COARSE, FULL, ...(isDense ? [SHARP] : [])];
  }

  // The pictures of a frame: the best one that is there, or a coarse one at first, and then better ones.
  async *pictures(_, index, isPlaying) {
    const step = Math.sign(index - (this.index ?? index));
    this.index = index;
    clearTimeout(this.filling);
    const wanted = ++this.wanted, qualities = this.qualities(isPlaying);
    const preview = this.isMoving || isPlaying ? null : await this.preview(index).catch(problem);
    if (preview && wanted === this.wanted) yield preview;
    const best = QUALITIES.findLast(quality => quality !== COARSE && this.found(quality, index));
    if (best) yield this.found(best, index);
    for (const quality of qualities.filter(quality => QUALITIES.indexOf(quality) > QUALITIES.indexOf(best))) {
      if (wanted !== this.wanted) return;
      const picture = await this.wantedPicture(quality, index, isPlaying, wanted).catch(error => this.orNone(error, quality));
      if (picture && (wanted === this.wanted || this.isMoving)) yield picture;
      if (quality === COARSE && step && !isPlaying && this.coarseTime <= SLOWEST) await this.loadNext(index, step, wanted);
    }
    if (wanted !== this.wanted || this.isMoving) return;
    if (isPlaying) this.playAhead(qualities[0], index);
    else this.fillLater(index);
  }

  // The picture within the page of what it shows first, if this is what is seen, in the shape of a coarse one. It shows while the engine
  // starts.
  async preview(index) {
    const { preview } = this.facts.file ?? {};
    if (!preview || this.kept.size || index !== this.opening || this.look.map || this.look.range) return null;
    const { archive, ...state } = this.state;
    if (Object.values(state).some(value => (value ?? null) !== null)) return null;
    const { about, blocks: [[, block]] } = preview.answer, { size } = this.measures(COARSE), step = preview.scale / this.scaleIn(size);
    const { size: [side], pictures: [planes] } = await readBlock(block), [ray] = about.rays;
    const shares = ray && sharesOf(seenFrom(ray, size.map(count => firstPlace(count, side, step)), step), size);
    return { planes: cut(planes, side, size, step), about: { ...about, size, mode: this.firstMode }, backdrop: null, shares, quality: COARSE };
  }

  // Completes the description of pictures.
  describe(about) {
    const { title, labels, maps } = this.facts;
    this.kind = about.kind;
    for (const name in about.maps) about.maps[name] = bytesOf(about.maps[name]);
    Object.assign(about, { maps: { ...maps, ...about.maps }, title, labels });
  }

  // Loads coarse pictures of the frames that a user who steps through time sees next, and of the one behind.
  async loadNext(index, step, wanted) {
    const last = this.sequences[0].pictures.length - 1;
    await new Promise(next => setTimeout(next)); // the picture is drawn meanwhile
    for (const ends of [[index + step, index + STEPS * step], [index - step, index - step]]) {
      if (wanted !== this.wanted || this.underWay?.rank === PLOT) return;
      const [one, other] = ends.map(frame => clamped(frame, 0, last));
      await this.loadMissing([Math.min(one, other), Math.max(one, other) + 1], COARSE).catch(problem);
    }
  }

  // Does without sharp pictures from then on if the server lacks memory for one.
  orNone(error, quality) {
    if (quality !== SHARP || !error.message.startsWith('memory')) throw error;
    this.isTooSharp = true;
    return null;
  }

  // Asks again if automatic colours were found meanwhile, for they are a part of what is asked for.
  async wantedPicture(quality, index, isPlaying, wanted) {
    for (;;) {
      const frames = isPlaying && !this.isMoving ? this.block(index, quality) : [index, index + 1];
      try {
        return this.found(quality, index) ?? await this.load(this.key(quality), { frames, quality, index, rank: USER });
      } catch (error) {
        if (!(error instanceof Stale) || wanted !== this.wanted) throw error;
      }
    }
  }

  // Loads the next frames while those before them play.
  playAhead(quality, index) {
    const [, next] = this.block(index, quality), first = next < this.sequences[0].pictures.length ? next : 0;
    if (this.found(quality, first) || this.found(FULL, first) || this.underWay) return;
    this.load(this.key(quality), { frames: this.block(first, quality), quality, index: first, rank: AHEAD }).catch(problem);
  }

  // A complete picture for a plot. Requests for what the user sees come first; then it asks again.
  async whole(_, index, isWanted) {
    const key = this.key(FULL);
    for (;;) {
      try {
        return this.kept.get(key)?.get(index) ?? await this.load(key, { frames: this.block(index, FULL), quality: FULL, index, rank: PLOT });
      } catch (error) {
        if (!isPassing(error) || !isWanted() || key !== this.key(FULL)) throw error;
        await pause(REST);
      }
    }
  }

  // The frames to ask for together, around one.
  block(index, quality) {
    const { look: { mode }, engine: { blockTime } } = this, [width, height] = this.measures(quality).size;
    if (mode === 'error') return [index, index + 1]; // errors take long
    const each = mode === 'composite' || mode === 'iso' || this.kind === 'channels' ? 4 : 1;
    const fit = Math.floor(this.facts.numbers / (width * height * each)), inTime = Math.floor(blockTime / (this.pace[mode] ?? blockTime));
    const count = clamped(Math.min(fit, quality === COARSE ? COARSE_FRAMES : inTime), 1, BLOCK_FRAMES), first = index - index % count;
    return [first, Math.min(first + count, this.sequences[0].pictures.length)];
  }

  // Loads pictures in turn. Stops a running request that does not help, and never sends one that is no longer wanted.
  async load(key, { frames, quality, index, rank, isSpare = false }) {
    const { underWay, turn: before } = this, isOfUser = rank === USER;
    const isHelp = underWay?.key === key && underWay.frames[0] <= index && index < underWay.frames[1];
    const isStopped = underWay && (underWay.quality !== COARSE || underWay.rank === AHEAD) && !isHelp;
    const stops = isStopped && (isOfUser || rank === AHEAD && underWay.rank === AHEAD);
    if (stops) underWay.stop.abort();
    const { wanted } = this;
    let done;
    this.turn = new Promise(resolve => { done = resolve; });
    this.waiting += isOfUser;
    try {
      await before.finally(() => { this.waiting -= isOfUser; });
      const kept = this.kept.get(key)?.get(index);
      if (kept) return kept;
      if (key !== this.key(quality) || (isOfUser ? wanted !== this.wanted : this.waiting > 0)) throw new Stale();
      this.underWay = { key, frames, quality, rank, isSpare, stop: new AbortController(), waits: stops };
      return (await this.ask(key, frames, quality)).get(index);
    } finally {
      this.underWay = null;
      done();
    }
  }

  async ask(key, frames, quality) {
    const { mode, range } = this.look, colours = this.colourKey(quality), isChosen = mode === 'composite' && range, begun = performance.now();
    const { stop, rank, isSpare } = this.underWay, request = { ...this.request(frames, quality), ahead: isSpare };
    const bytes = await this.answer('pictures', request, { signal: stop.signal, isCoarse: quality === COARSE }, rank), ended = performance.now();
    if (!this.underWay?.waits) this.learnPace(mode, quality, (ended - begun) / (frames[1] - frames[0]), frames); // not for what was stopped
    const { about, blocks, errors } = partsOf(bytes);
    this.describe(about);
    this.lacksErrors = mode === 'error' && !errors; // frames that were not converted have none
    about.mode = this.lacksErrors ? 'mean' : mode;
    if (mode === 'slice') this.ofSlices = colours;
    if (!isChosen) this.learnColours(colours, about, quality);
    const kept = this.remembered(key), decoding = about.backdrops[0] ? pixelsOf(about.backdrops[0], about.size) : null;
    const shares = about.rays[0] && sharesOf(about.rays[0], about.size), backdrop = await decoding;
    for (const [{ first }, block] of blocks) {
      const { pictures } = await readBlock(block);
      const number = n => frames[0] + first + n; // a picture that is shown already stays
      pictures.forEach((planes, n) => kept.has(number(n)) || kept.set(number(n), { planes, about, backdrop, shares, quality }));
    }
    if (errors) this.showErrors(kept, frames[0], (await readBlock(errors)).pictures);
    return kept;
  }

  // Keeps the automatic colours of the first full answer of a mode, and those of a coarse one until then.
  learnColours(colours, about, quality) {
    const isFull = quality !== COARSE, before = this.known[colours];
    if (before && (before.isFull || !isFull)) return;
    if (before) this.kept.forEach((pictures, key) => { if (pictures.values().next().value?.quality === COARSE) this.kept.delete(key); });
    const isOfValues = about.kind === 'value', opacity = isFull && about.opacity ? simplified(about.opacity) : null;
    this.known[colours] = { range: about.range, clear: isOfValues ? about.clear?.slice(0, 2) ?? [] : null, beyond: about.rays[0] ? about.beyond : null, opacity, isFull };
  }

  // Learns how long pictures of a mode take: coarse ones become coarser if they are late.
  learnPace(mode, quality, milliseconds, [first, end]) {
    if (quality === FULL) this.pace[mode] = milliseconds;
    if (quality !== COARSE || end - first > 1) return;
    this.coarseTime = milliseconds;
    const n = this.rung(mode), two = [milliseconds, this.lastPace[mode] ?? (SOON + LATE) / 2];
    const by = Math.min(...two) > LATE ? 1 : Math.max(...two) < SOON ? -1 : 0;
    this.coarser[mode] = clamped(n + by, 0, COARSER.length - 1);
    this.lastPace[mode] = by ? undefined : milliseconds;
  }

  // Puts the errors of pixels in front of their values.
  showErrors(kept, first, pictures) {
    this.largestError ??= pictures[0][0].reduce((most, error) => error > most ? error : most, 0) || 1;
    pictures.forEach((planes, n) => {
      const { planes: [beneath], about, ...rest } = kept.get(first + n);
      const values = `largest error of ${about.values || 'values'}`;
      kept.set(first + n, { ...rest, planes, beneath, shares: null, about: { ...about, values, range: [0, this.largestError], clear: null, log: false } });
    });
  }

  // The pictures of a look, within the memory of the page.
  remembered(key) {
    const kept = this.kept.get(key) ?? new Map();
    this.kept.delete(key);
    this.kept.set(key, kept);
    const bytes = pictures => {
      const all = [...pictures.values()], parts = new Set(all.flatMap(({ planes, beneath, shares, backdrop }) => [...planes, beneath, shares, backdrop]));
      return [...parts].reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
    };
    let all = [...this.kept.values()].reduce((sum, pictures) => sum + bytes(pictures), 0);
    const { keptBytes: most = KEPT_BYTES } = this.engine;
    for (const [oldest, pictures] of this.kept) {
      if (all <= most || oldest === key) break;
      all -= bytes(pictures);
      this.kept.delete(oldest);
    }
    if (all > most) kept.clear();
    return kept;
  }

  // Asks for pictures beside one that is shown, unless something else is wanted.
  fillLater(index) {
    clearTimeout(this.filling);
    this.filling = setTimeout(() => this.fill(index).catch(problem), IDLE);
  }

  // Loads coarse pictures of the frames beside, and then full ones of the frames around and behind.
  async fill(index) {
    const count = this.sequences[0].pictures.length, around = this.block(index, FULL), { wanted } = this;
    const beside = [clamped(index - 2, 0, count - 1), clamped(index + 4, 1, count)];
    if (this.look.mode !== 'error') await this.loadMissing(beside, COARSE);
    for (const frames of [around, ...(around[1] < count ? [this.block(around[1], FULL)] : [])]) {
      if (wanted !== this.wanted) return;
      await this.loadMissing(frames, FULL);
    }
    if (wanted !== this.wanted) return;
    document.documentElement.dataset.filled = index;
    this.filled();
  }

  // Loads the pictures of some frames from the first one on that is not there. Nobody waits for them.
  async loadMissing([first, end], quality) {
    const isThere = frame => this.found(quality, frame) || quality === COARSE && this.found(FULL, frame);
    const { wanted, engine: { together = end - first } } = this;
    for (let frame = first; frame < end && wanted === this.wanted; frame++) {
      if (isThere(frame)) continue;
      const frames = [frame, frame + 1];
      while (frames[1] < Math.min(frame + together, end) && !isThere(frames[1])) frames[1] += 1;
      await this.load(this.key(quality), { frames, quality, index: frame, rank: AHEAD, isSpare: true });
      frame = frames[1] - 1;
    }
  }

  // Stops what is asked for: something else is wanted.
  halt() {
    clearTimeout(this.filling);
    this.underWay?.stop.abort();
  }

  // Nothing moves any more.
  rest() {
    if (this.isMoving) this.change({}, false);
  }

  // Changes what is seen. While something moves, pictures are coarse.
  change(changes, isMoving) {
    const isOther = name => name in changes && JSON.stringify(changes[name]) !== JSON.stringify(this.look[name]);
    if (!Object.keys(changes).length || ['mode', 'view', 'center', 'zoom', 'slices'].some(isOther)) this.moved();
    Object.assign(this.look, changes);
    delete document.documentElement.dataset.filled;
    clearTimeout(this.filling);
    this.isMoving = isMoving;
    clearTimeout(this.resting);
    if (isMoving) this.resting = setTimeout(() => this.change({}, false), REST);
    this.changed();
  }

  // The answer to a question, in bytes. Shows what the user waits for.
  async answer(name, request, how = {}, rank = USER) {
    const what = name === 'save' ? 'making the file' : request.certify ? 'bounding the errors' : 'drawing';
    let isDone = false;
    const working = setInterval(async () => {
      const share = rank === USER ? await this.engine.progress() : undefined;
      if (share !== undefined && !isDone) say('status', share === null ? `${what} …` : `${what}, ${Math.round(100 * share)} %`);
    }, PATIENCE);
    try {
      return await this.engine.ask(name, request, how);
    } finally {
      isDone = true;
      clearInterval(working);
      setTimeout(() => say('status', ''));
    }
  }

  // Asks for a file of the current view, or for its command.
  async made(name, file) {
    const frames = file.endsWith('.png') ? [this.index, this.index + 1] : [0, this.sequences[0].pictures.length];
    const certify = name === 'command' && this.look.mode === 'error';
    return this.answer(name, { ...this.request(frames, FULL, this.colours()), certify, file });
  }
}
