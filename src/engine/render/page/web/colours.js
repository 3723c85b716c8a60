// From numbers to the colours of pixels, as src/colour/scale.rs does it.

const SHARES = 4096;

// The colours of a map at even shares of the range, from its colours at fewer shares, two bytes for each number.
function tableOf(bytes) {
  const numbers = Float64Array.from({ length: bytes.length / 2 }, (_, i) => (bytes[2 * i] + 256 * bytes[2 * i + 1]) / 257);
  const last = numbers.length / 3 - 1, table = new Uint8Array(3 * (SHARES + 1));
  for (let i = 0; i <= SHARES; i++) {
    const at = i / SHARES * last, below = Math.min(Math.floor(at), last - 1), part = at - below;
    for (let c = 0; c < 3; c++) {
      const low = numbers[3 * below + c], high = numbers[3 * below + 3 + c];
      table[3 * i + c] = Math.round(low + part * (high - low));
    }
  }
  return table;
}

// Maps with 0 in the middle of signed ranges: those in which one side of 0 is longer than this share of the other.
const DIVERGING = ['coolwarm'], SIDE = 0.05;
// Ranges that begin below this share of their end begin at 0.
const NEAR = 0.25;

// The range to stretch a map over, as src/colour/mod.rs has it.
function suitable([low, high], map) {
  const isSigned = low < -SIDE * high && high > -SIDE * low, most = Math.max(high, -low);
  if (DIVERGING.includes(map) && isSigned) return [-most, most];
  return [low >= 0 && low < NEAR * high ? 0 : low, high];
}

// The colours of values: a map over a range, which may be logarithmic and bent by gamma.
class Scale {
  constructor({ table, range, log = false, gamma = 1, clear = null }) {
    Object.assign(this, { table, log: log && range[0] > 0, gamma, clear });
    this.range = range;
    this.ends = this.log ? range.map(Math.log) : range;
  }

  // The place of a value in the range, 0 to 1.
  share(value) {
    const [low, high] = this.ends;
    const share = ((this.log ? Math.log(Math.max(value, Number.MIN_VALUE)) : value) - low) / (high - low);
    const within = share > 0 ? Math.min(share, 1) : 0;
    return this.gamma === 1 ? within : within ** this.gamma;
  }

  // How much of its colour a value shows, 0 to 1. Values of empty space show the background.
  presence(value) {
    if (!this.clear) return 1;
    const [low, high, fade] = this.clear, away = Math.max(low - value, value - high);
    const share = fade > 0 ? Math.min(Math.max(away / fade, 0), 1) : Number(away > 0);
    return share * share * (3 - 2 * share);
  }
}

// Paints the planes of a picture over a background, both as RGBA bytes.
function paint(planes, kind, scale, background, pixels) {
  if (kind === 'value') return paintValues(planes[0], scale, background, pixels);
  return kind === 'light' ? paintLight(planes, background, pixels) : paintChannels(planes, scale, background, pixels);
}

function paintValues(values, scale, background, pixels) {
  const { table } = scale;
  for (let i = 0, at = 0; i < values.length; i++, at += 4) {
    const value = values[i], presence = value === value ? scale.presence(value) : 0, rest = 1 - presence;
    const entry = presence && 3 * Math.round(scale.share(value) * SHARES);
    pixels[at] = presence * table[entry] + rest * background[at];
    pixels[at + 1] = presence * table[entry + 1] + rest * background[at + 1];
    pixels[at + 2] = presence * table[entry + 2] + rest * background[at + 2];
  }
}

function paintLight(planes, background, pixels) {
  const opacity = planes[3];
  for (let i = 0, at = 0; i < opacity.length; i++, at += 4) {
    const rest = 1 - opacity[i];
    for (let c = 0; c < 3; c++) {
      const behind = background[at + c];
      pixels[at + c] = rest === rest ? 255 * planes[c][i] + rest * behind : behind;
    }
  }
}

function paintChannels(planes, scale, background, pixels) {
  for (let c = 0; c < 3; c++) {
    const plane = planes[c];
    for (let i = 0, at = c; i < plane.length; i++, at += 4) {
      pixels[at] = plane[i] === plane[i] ? 255 * scale.share(plane[i]) : background[at];
    }
  }
}

// The lengths of the rays of all pixels, as shares of the longest one, as src/engine/render/ray_lengths.rs has them. Along a
// row, the places where rays meet a side change evenly.
function sharesOf({ from, right, down, along, ends, longest }, [width, height]) {
  const shares = new Float32Array(width * height);
  for (let y = 0, at = 0; y < height; y++) {
    const sides = [0, 1, 2].map(a => {
      const start = from[a] + y * down[a], met = ends[a].map(end => (end - start) / along[a]);
      return along[a] === 0 ? [-Infinity, Infinity, 0] : [Math.min(...met), Math.max(...met), right[a] / along[a]];
    });
    const [[near0, far0, step0], [near1, far1, step1], [near2, far2, step2]] = sides;
    for (let x = 0; x < width; x++, at++) {
      const near = Math.max(near0 - x * step0, near1 - x * step1, near2 - x * step2);
      const far = Math.min(far0 - x * step0, far1 - x * step1, far2 - x * step2);
      shares[at] = Math.min(Math.max(far - near, 0) / longest, 1);
    }
  }
  for (const a of [0, 1, 2].filter(a => along[a] === 0)) removeBeside(shares, (x, y) => from[a] + x * right[a] + y * down[a], ends[a], width);
  return shares;
}

// Removes rays that pass beside two sides that they are parallel to.
function removeBeside(shares, place, [low, high], width) {
  for (let at = 0; at < shares.length; at++) {
    const start = place(at % width, Math.floor(at / width));
    if (start < low || start > high) shares[at] = 0;
  }
}

// Values as if all rays were equally long (eq 51).
function weighed(values, shares, beyond) {
  if (!shares) return values;
  const found = new Float32Array(values.length);
  for (let i = 0; i < found.length; i++) found[i] = beyond + shares[i] * (values[i] - beyond);
  return found;
}
