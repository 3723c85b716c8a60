// The source of a page that asks its server for pictures.

const FULL_PIXELS = 1024, MOVING_PIXELS = 288; // sides of pictures at rest, and while something moves
const BLOCK_FRAMES = 32, BLOCK_NUMBERS = 2 ** 24; // frames of a request, and their numbers
const REST = 250; // milliseconds without a change after which pictures are complete
const PATIENCE = 600; // milliseconds after which a request says how far it is
const SLOW = 30e6; // bytes per second below which answers are packed

// Ranks of requests. A request never cancels one of higher rank.
const AHEAD = 0, PLOT = 1, USER = 2;

class Stale extends Error {}

// Numbers with nine digits: a picture of 4096 pixels shows no more.
const short = number => Number(number.toPrecision(9)), texts = numbers => numbers.map(short).join();

const pause = milliseconds => new Promise(next => setTimeout(next, milliseconds));

class Live {
  constructor(facts) {
    for (const name in facts.maps) facts.maps[name] = bytesOf(facts.maps[name]);
    this.facts = facts;
    this.first = {
      title: facts.title, values: facts.values, size: [1, 1], kind: 'value', background: [0, 0, 0], range: facts.range ?? [0, 1],
      log: false, clear: null, maps: facts.maps, map: 'viridis', fps: 25, labels: facts.labels, settings: {}, mode: '',
    };
    this.about = this.first;
    this.opening = facts.opening;
    this.sequences = [{ label: '', pictures: facts.labels.map((_, frame) => ({ view: 0, frame })) }];
    this.look = { mode: 'mean', slices: [], iso: [], opacity: null, range: null, shade: false, annotate: 'box,axes', ...this.home() };
    this.known = {}; // automatic range and clear values of each mode, from its first answer
    this.kept = new Map(); // pictures of each look, the last one used at the end
    this.turn = Promise.resolve();
    this.underWay = null; // the request that is asked
    this.wanted = 0; // how many requests of the user there were
    this.waiting = 0; // and how many of them wait
    this.isMoving = this.isSlow = false;
  }

  home() { return { view: [30, 30], center: this.facts.center, zoom: 1 }; }

  // Pixels of a picture at rest: as many as the window has room for.
  fullSize() {
    const { clientWidth, clientHeight } = element('frame-of-picture'), room = [clientWidth, clientHeight].map(side => Math.max(side, 120));
    const density = window.devicePixelRatio || 1, most = Math.min(density, FULL_PIXELS / Math.max(...room));
    return room.map(side => Math.round(side * most));
  }

  // The request for the pictures of some frames: fields of a PictureRequest, as the texts of its options.
  request(frames, isFull, chosen = {}) {
    const { mode, view, center, zoom, map, range, opacity, slices, iso, shade, annotate, theme } = this.look, full = this.fullSize();
    const part = isFull ? 1 : Math.min(1, MOVING_PIXELS / Math.max(...full));
    const size = full.map(side => Math.max(1, Math.round(side * part)));
    const lod = isFull || mode === 'slice' ? 0 : Math.min(this.facts.coarsest, 1);
    const isOfErrors = mode === 'error', isComposite = mode === 'composite';
    const colours = { map, ...this.known[this.colourKey(isFull)], ...(isComposite && range ? { range } : {}), ...chosen };
    const look = {
      mode: isOfErrors || mode === 'mean' ? undefined : mode, view: [view.join()], center: texts(center), size: size.join('x'),
      scale: short(zoom * 0.95 * Math.min(...size) / (2 * this.facts.radius)), lod: lod || undefined, frames: frames?.join(':'),
      shade: isComposite && shade, opacity: isComposite ? opacity?.map(point => point.join(':')).join() : undefined,
      iso: iso.length ? iso.join() : undefined, slice: slices.length ? slices.map(([axis, share]) => `${axis}=${short(100 * share)}%`) : undefined,
      annotate, theme, ...this.coloursOf(mode, colours),
    };
    return { look, certify: isOfErrors && isFull, packed: this.isSlow };
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
  colourKey(isFull) {
    const { mode, map, slices } = this.look;
    if (mode !== 'slice') return `${mode === 'error' ? 'mean' : mode} ${map ?? ''}`;
    const own = `slice ${JSON.stringify(slices)}`;
    return isFull || this.known[own] ? own : this.ofSlices ?? own;
  }

  // A key for all requests that differ only in the frame.
  key(isFull) {
    const isChosen = this.look.mode === 'composite' && this.look.range;
    const { look, certify } = this.request(null, isFull);
    return JSON.stringify({ ...look, ...(isChosen ? {} : { range: null }), clear: null, beyond: null, certify, colours: this.colourKey(isFull) });
  }

  // A picture: complete if nothing moves, else a small one.
  async picture(_, index, isPlaying) {
    this.index = index;
    clearTimeout(this.filling);
    for (const wanted = ++this.wanted; ;) {
      const isFull = !this.isMoving, key = this.key(isFull);
      const kept = this.kept.get(this.key(true))?.get(index) ?? this.kept.get(key)?.get(index);
      const frames = isPlaying && isFull ? this.block(index) : [index, index + 1];
      try {
        const picture = kept ?? await this.load(key, { frames, isFull, index, rank: USER });
        if (isFull && wanted === this.wanted) this.fillLater(index);
        return picture;
      } catch (error) {
        if (!(error instanceof Stale) || wanted !== this.wanted) throw error; // else automatic colours were found meanwhile
      }
    }
  }

  // A complete picture for a plot. Requests for what the user sees come first; then it asks again.
  async whole(_, index, isWanted) {
    const key = this.key(true);
    for (;;) {
      try {
        return this.kept.get(key)?.get(index) ?? await this.load(key, { frames: this.block(index), isFull: true, index, rank: PLOT });
      } catch (error) {
        if (!isPassing(error) || !isWanted() || key !== this.key(true)) throw error;
        await pause(REST);
      }
    }
  }

  // The frames to ask for together, around one.
  block(index) {
    const { mode } = this.look, [width, height] = this.fullSize();
    if (mode === 'error') return [index, index + 1]; // errors take long
    const numbers = mode === 'composite' || mode === 'iso' || this.kind === 'channels' ? 4 : 1;
    const count = Math.min(Math.max(Math.floor(BLOCK_NUMBERS / (width * height * numbers)), 1), BLOCK_FRAMES);
    const first = index - index % count;
    return [first, Math.min(first + count, this.sequences[0].pictures.length)];
  }

  // Loads pictures in turn. Stops a running request that does not help, and never sends one that is no longer wanted.
  async load(key, { frames, isFull, index, rank }) {
    const { underWay, turn: before } = this, isOfUser = rank === USER;
    const isHelp = underWay?.key === key && underWay.frames[0] <= index && index < underWay.frames[1];
    if (underWay?.isFull && !isHelp && (isOfUser || rank === AHEAD && underWay.rank === AHEAD)) underWay.stop.abort();
    const { wanted } = this;
    let done;
    this.turn = new Promise(resolve => { done = resolve; });
    this.waiting += isOfUser;
    try {
      await before.finally(() => { this.waiting -= isOfUser; });
      const kept = this.kept.get(key)?.get(index);
      if (kept) return kept;
      if (key !== this.key(isFull) || (isOfUser ? wanted !== this.wanted : this.waiting > 0)) throw new Stale();
      this.underWay = { key, frames, isFull, rank, stop: new AbortController() };
      return (await this.ask(key, frames, isFull)).get(index);
    } finally {
      this.underWay = null;
      done();
    }
  }

  async ask(key, frames, isFull) {
    const { mode, range } = this.look, colours = this.colourKey(isFull), isChosen = mode === 'composite' && range;
    const answer = await this.post('pictures', this.request(frames, isFull), this.underWay.stop.signal);
    const started = performance.now(), bytes = new Uint8Array(await answer.arrayBuffer());
    if (bytes.length > 2 ** 20 && bytes.length / (performance.now() - started) * 1000 < SLOW) this.isSlow = true;
    const length = new DataView(bytes.buffer).getUint32(0, true);
    const { about, blocks, errors, opacity } = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    this.kind = about.kind;
    for (const name in about.maps) about.maps[name] = bytesOf(about.maps[name]);
    const { title, labels } = this.facts;
    Object.assign(about, { maps: { ...this.facts.maps, ...about.maps }, title, labels, hasBar: mode === 'composite', opacity });
    about.mode = mode === 'error' && !errors ? 'mean' : mode;
    if (mode === 'slice') this.ofSlices = colours;
    if (!isChosen) this.known[colours] ??= { range: about.range, clear: about.kind === 'value' ? about.clear?.slice(0, 2) ?? [] : null, beyond: about.rays[0] ? about.beyond : null };
    const kept = this.remembered(key), backdrop = about.backdrops[0] ? await pixelsOf(about.backdrops[0], about.size) : null;
    const shares = about.rays[0] && sharesOf(about.rays[0], about.size);
    let at = 4 + length;
    for (const [{ first }, size] of blocks) {
      const { pictures } = await readBlock(bytes.subarray(at, at += size));
      pictures.forEach((planes, n) => kept.set(frames[0] + first + n, { planes, about, backdrop, shares }));
    }
    if (errors) this.showErrors(kept, frames[0], (await readBlock(bytes.subarray(at, at + errors))).pictures);
    return kept;
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
    const bytes = pictures => [...pictures.values()].reduce((sum, { planes }) => sum + planes.length * planes[0].byteLength, 0);
    let all = [...this.kept.values()].reduce((sum, pictures) => sum + bytes(pictures), 0);
    for (const [oldest, pictures] of this.kept) {
      if (all <= KEPT_BYTES || oldest === key) break;
      all -= bytes(pictures);
      this.kept.delete(oldest);
    }
    if (all > KEPT_BYTES) kept.clear();
    return kept;
  }

  // Asks for the frames around a picture, and for those behind them, unless something else is wanted.
  fillLater(index) {
    clearTimeout(this.filling);
    this.filling = setTimeout(() => this.fill(index).catch(problem), REST);
  }

  async fill(index) {
    const key = this.key(true), around = this.block(index), last = this.sequences[0].pictures.length;
    for (const frames of [around, ...(around[1] < last ? [this.block(around[1])] : [])]) {
      let missing = frames[0];
      while (missing < frames[1] && this.kept.get(key)?.has(missing)) missing++;
      if (missing < frames[1]) await this.load(key, { frames, isFull: true, index: missing, rank: AHEAD });
    }
    document.documentElement.dataset.filled = index;
  }

  // Stops loading pictures ahead of the user.
  halt() {
    clearTimeout(this.filling);
    if (this.underWay?.rank === AHEAD) this.underWay.stop.abort();
  }

  // Changes what is seen. While something moves, pictures are small.
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

  // Asks the server, again and again until it answers. Shows its progress while it works.
  async post(where, request, signal) {
    const working = setInterval(async () => {
      const share = await fetch('progress').then(answer => answer.text()).catch(() => '');
      if (share) say('status', `rendering, ${Math.round(100 * share)} %`);
    }, PATIENCE);
    try {
      const answer = await this.patiently(where, { method: 'POST', body: JSON.stringify(request), signal });
      if (!answer.ok) throw new Error(await answer.text() || answer.statusText);
      return answer;
    } finally {
      clearInterval(working);
      setTimeout(() => say('status', ''));
    }
  }

  async patiently(where, options) {
    for (;;) {
      try {
        return await fetch(where, options);
      } catch (error) {
        if (options.signal?.aborted || !(error instanceof TypeError)) throw error;
        say('status', 'wavesplat view does not answer. If it has ended, start it again.');
        await pause(1000);
      }
    }
  }

  // Asks for a file of the current view, or for its command.
  async made(where, file) {
    const frames = file.endsWith('.png') ? [this.index, this.index + 1] : [0, this.sequences[0].pictures.length];
    const certify = where === 'command' && this.look.mode === 'error';
    return this.post(`${where}?${new URLSearchParams({ file })}`, { ...this.request(frames, true, this.colours()), certify });
  }
}
