// The source of a page that asks its server for pictures.

const FULL_PIXELS = 1024, MOVING_PIXELS = 288; // sides of pictures at rest, and while something moves
const BLOCK_FRAMES = 32, BLOCK_NUMBERS = 2 ** 24; // frames of a request, and their numbers
const REST = 250; // milliseconds without a change after which pictures are complete

class Stale extends Error {}

class Live {
  constructor(facts) {
    for (const name in facts.maps) facts.maps[name] = bytesOf(facts.maps[name]);
    this.facts = facts;
    this.first = {
      title: facts.title, values: facts.values, size: [1, 1], kind: 'value', background: [0, 0, 0], range: facts.range ?? [0, 1],
      log: false, clear: null, maps: facts.maps, map: 'viridis', fps: 25, labels: facts.labels, settings: {}, key: '',
    };
    this.about = this.first;
    this.sequences = [{ label: '', pictures: facts.labels.map((_, frame) => ({ view: 0, frame })) }];
    this.look = { mode: 'mean', slices: [], iso: [], opacity: null, shade: false, annotate: true, light: false, zoom: 1, ...this.home() };
    this.known = {}; // range and clear values of each mode, from its first answer
    this.kept = new Map(); // pictures of each look, the last one used at the end
    this.turn = Promise.resolve();
    this.isMoving = false;
  }

  home() { return { view: [30, 30], center: this.facts.center, zoom: 1 }; }

  // Pixels of a picture at rest: as many as the window has room for.
  fullSize() {
    const room = [document.querySelector('main').clientWidth - 150, 0.7 * window.innerHeight].map(side => Math.max(side, 120));
    const most = Math.min(1, FULL_PIXELS / Math.max(...room) / (window.devicePixelRatio || 1));
    return room.map(side => Math.round(side * most * (window.devicePixelRatio || 1)));
  }

  // The request for the pictures of some frames.
  request(frames, isFull) {
    const { mode, zoom, opacity, ...look } = this.look, full = this.fullSize();
    const part = isFull ? 1 : Math.min(1, MOVING_PIXELS / Math.max(...full));
    const size = full.map(side => Math.max(1, Math.round(side * part)));
    const scale = zoom * 0.95 * Math.min(...size) / (2 * this.facts.radius);
    const lod = isFull || mode === 'slice' ? 0 : Math.min(this.facts.coarsest, 1);
    const { range = null, clear = null } = this.known[this.modeKey()] ?? {};
    return { mode, ...look, ...(opacity && mode === 'composite' ? { opacity } : {}), size, scale, lod, frames, range, clear };
  }

  modeKey() { return `${this.look.mode} ${this.look.map ?? ''}`; }

  key(isFull) { return JSON.stringify(this.request(null, isFull)); }

  // A picture: complete if nothing moves, else a small one.
  async picture(_, index) {
    this.index = index;
    const isFull = !this.isMoving, key = this.key(isFull);
    const kept = this.kept.get(this.key(true))?.get(index) ?? this.kept.get(key)?.get(index);
    const picture = kept ?? await this.load(key, [index, index + 1], isFull, index);
    if (isFull) this.fillLater(index);
    return picture;
  }

  // Loads pictures in turn. Those that nobody wants any more are not asked for.
  async load(key, frames, isFull, index) {
    const before = this.turn;
    let done;
    this.turn = new Promise(resolve => { done = resolve; });
    try {
      await before;
      const kept = this.kept.get(key)?.get(index);
      if (kept) return kept;
      if (key !== this.key(isFull)) throw new Stale();
      return (await this.ask(key, frames, isFull)).get(index);
    } finally { done(); }
  }

  async ask(key, frames, isFull) {
    const answer = await fetch('pictures', { method: 'POST', body: JSON.stringify(this.request(frames, isFull)) });
    if (!answer.ok) throw new Error(await answer.text());
    const bytes = new Uint8Array(await answer.arrayBuffer());
    const length = new DataView(bytes.buffer).getUint32(0, true);
    const { about, blocks } = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    for (const name in about.maps) about.maps[name] = bytesOf(about.maps[name]);
    Object.assign(about, { maps: { ...this.facts.maps, ...about.maps }, title: this.facts.title, labels: this.facts.labels, key: this.modeKey() });
    const kept = this.remembered(key), backdrop = about.backdrops[0] ? await pixelsOf(about.backdrops[0], about.size) : null;
    let at = 4 + length;
    for (const [{ first }, size] of blocks) {
      const { pictures } = await readBlock(bytes.subarray(at, at += size));
      pictures.forEach((planes, n) => kept.set(frames[0] + first + n, { planes, about, backdrop }));
    }
    this.known[this.modeKey()] ??= { range: about.range, clear: about.kind === 'value' ? about.clear?.slice(0, 2) ?? [] : null };
    if (key !== this.key(isFull)) this.kept.set(this.key(isFull), kept); // its range is known now
    return kept;
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

  // Asks for the frames around a picture, and for those behind them, as soon as nothing else is wanted.
  fillLater(index) {
    clearTimeout(this.filling);
    this.filling = setTimeout(() => this.fill(index).catch(error => { if (!(error instanceof Stale)) problem(error); }), REST);
  }

  async fill(index) {
    const key = this.key(true), [width, height] = this.fullSize(), numbers = this.about.kind === 'light' ? 4 : 1;
    const count = Math.min(Math.max(Math.floor(BLOCK_NUMBERS / (width * height * numbers)), 1), BLOCK_FRAMES);
    const last = this.sequences[0].pictures.length, first = index - index % count;
    for (const start of [first, first + count].filter(start => start < last)) {
      const end = Math.min(start + count, last), missing = () => {
        for (let frame = start; frame < end; frame++) if (!this.kept.get(key)?.has(frame)) return frame;
        return null;
      };
      if (missing() !== null) await this.load(key, [start, end], true, missing());
    }
    document.documentElement.dataset.filled = index;
  }

  // Changes what is seen. While something moves, pictures are small.
  change(changes, isMoving) {
    Object.assign(this.look, changes);
    clearTimeout(this.filling);
    this.isMoving = isMoving;
    clearTimeout(this.resting);
    if (isMoving) this.resting = setTimeout(() => this.change({}, false), REST);
    this.changed();
  }

  async command(file) { return this.post('command', file); }

  async post(where, file) {
    const frames = file.endsWith('.png') ? [this.index, this.index + 1] : [0, this.sequences[0].pictures.length];
    const answer = await fetch(`${where}?${new URLSearchParams({ file })}`, { method: 'POST', body: JSON.stringify({ ...this.request(frames, true), ...this.colours() }) });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  }
}
