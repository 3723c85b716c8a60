// The source of a page that holds all its pictures.

// Bytes of pictures that are kept unpacked.
const KEPT_BYTES = 512 * 2 ** 20;

function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

class Stored {
  constructor(about) {
    this.about = about;
    this.opening = about.opening;
    const { maps, sequences, settings } = this.about;
    this.about.hasBar = settings?.mode === 'composite';
    for (const name in maps) maps[name] = bytesOf(maps[name]);
    const pictures = list => list.map(([view, frame]) => ({ view, frame }));
    this.sequences = sequences.map(({ label, pictures: list }) => ({ label, pictures: pictures(list) }));
    this.blocks = Array.from(document.querySelectorAll('script.block'), script => ({
      script, sequence: Number(script.dataset.sequence), first: Number(script.dataset.first), count: Number(script.dataset.count),
    }));
    this.unpacked = new Map(); // the block that was used last is at the end
    this.backdrops = new Map();
  }

  async *pictures(sequence, index) {
    yield this.whole(sequence, index);
  }

  loaded() { return () => true; }

  async whole(sequence, index) {
    const holds = block => block.sequence === sequence && block.first <= index && index < block.first + block.count;
    const block = this.blocks.find(holds);
    if (!block) throw new Error(`this page lacks picture ${index}`);
    const { view } = this.sequences[sequence].pictures[index];
    const [{ pictures }, backdrop] = await Promise.all([this.unpack(block), this.backdrop(view)]);
    return { planes: pictures[index - block.first], about: this.about, backdrop, shares: this.shares(view) };
  }

  unpack(block) {
    const found = this.unpacked.get(block) ?? readBlock(bytesOf(block.script.textContent));
    this.unpacked.delete(block);
    this.unpacked.set(block, found);
    const [width, height] = this.about.size, each = 4 * width * height * this.blocks[0].count;
    for (const oldest of this.unpacked.keys()) {
      if (this.unpacked.size <= 2 || this.unpacked.size * each <= KEPT_BYTES) break;
      this.unpacked.delete(oldest);
    }
    return found;
  }

  // The backdrop of a view, which lies behind its pictures.
  backdrop(view) {
    const address = this.about.backdrops[view];
    if (!address) return null;
    if (!this.backdrops.has(view)) this.backdrops.set(view, pixelsOf(address, this.about.size));
    return this.backdrops.get(view);
  }

  // The lengths of the rays of the view that was shown last.
  shares(view) {
    const { rays, size } = this.about;
    if (this.ofView?.view !== view) this.ofView = { view, shares: rays[view] && sharesOf(rays[view], size) };
    return this.ofView.shares;
  }
}

// The RGBA bytes of a picture at an address.
async function pixelsOf(address, size) {
  const image = new Image();
  image.src = address;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = size;
  const context = canvas.getContext('2d', { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, ...size).data;
}
