// Reads blocks of pictures: the inverse of block.rs.

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The pictures of a block: for each picture a list of planes of numbers, NaN where there is none.
async function readBlock(bytes) {
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const body = bytes.subarray(4 + length);
  const planes = head.step === 0 ? rawPlanes(head, body) : await codedPlanes(head, body);
  const pictures = [];
  for (let n = 0; n < planes.length; n += head.numbers) pictures.push(planes.slice(n, n + head.numbers));
  return { size: head.size, pictures };
}

function rawPlanes({ size, numbers, pictures }, body) {
  const pixels = size[0] * size[1];
  const aligned = body.byteOffset % 4 === 0 ? body : body.slice();
  const plane = (_, n) => new Float32Array(aligned.buffer, aligned.byteOffset + 4 * n * pixels, pixels);
  return Array.from({ length: pictures * numbers }, plane);
}

async function codedPlanes({ size, numbers, step, log, lengths, missing }, body) {
  let at = 0;
  const parts = [...lengths, missing].map(length => body.subarray(at, at += length));
  const bytes = await Promise.all(parts.map(part => part.length ? inflated(part) : null));
  const mask = bytes.pop();
  const planes = bytes.map(part => decoded(part, size, step));
  inverseHaar(planes, numbers);
  if (log) planes.forEach(plane => plane.forEach((number, i) => { plane[i] = Math.exp(number); }));
  if (mask) removeMissing(planes, numbers, mask);
  return planes;
}

// A plane of coefficients: for every pixel, the expected number plus the difference in the bytes.
function decoded(bytes, [width, height], step) {
  const pixels = width * height, plane = new Float32Array(pixels);
  if (!bytes) return plane;
  const found = new Float64Array(pixels);
  let next = 0;
  const rest = () => {
    const folded = bytes[next] | bytes[pixels + next] << 8 | bytes[2 * pixels + next] << 16;
    next++;
    return folded >>> 1 ^ -(folded & 1);
  };
  const between = (at, along, length, gap, stride) => {
    const before = found[at - stride];
    if (along + gap >= length) return before;
    const sum = before + found[at + stride];
    if (along < 3 * gap || along + 3 * gap >= length) return sum / 2;
    return (9 * sum - found[at - 3 * stride] - found[at + 3 * stride]) / 16;
  };
  found[0] = rest();
  for (let gap = 2 ** Math.ceil(Math.log2(Math.max(width, height))) / 2; gap >= 1; gap /= 2) {
    for (let y = 0; y < height; y += 2 * gap) {
      for (let x = gap; x < width; x += 2 * gap) {
        const at = y * width + x;
        found[at] = between(at, x, width, gap, gap) + rest();
      }
    }
    for (let y = gap; y < height; y += 2 * gap) {
      for (let x = 0; x < width; x += gap) {
        const at = y * width + x;
        found[at] = between(at, y, height, gap, gap * width) + rest();
      }
    }
  }
  for (let i = 0; i < pixels; i++) plane[i] = found[i] * step;
  return plane;
}

// The inverse of the orthonormal Haar transform over time, in place.
function inverseHaar(planes, numbers) {
  let half = numbers;
  while (2 * half < planes.length) half *= 2;
  for (; half >= numbers; half /= 2) {
    for (let start = 0; start + half < planes.length; start += 2 * half) {
      for (let n = start; n < start + numbers; n++) turn(planes[n], planes[n + half]);
    }
  }
}

function turn(a, b) {
  for (let i = 0; i < a.length; i++) {
    const sum = (a[i] + b[i]) * Math.SQRT1_2;
    b[i] = (a[i] - b[i]) * Math.SQRT1_2;
    a[i] = sum;
  }
}

// Each byte of the mask is 1 where a number is missing and was not in the picture before, or the other way round.
function removeMissing(planes, numbers, mask) {
  const pixels = planes[0].length, state = new Uint8Array(numbers * pixels);
  planes.forEach((plane, p) => {
    const first = p % numbers * pixels;
    for (let i = 0; i < pixels; i++) {
      if (state[first + i] ^= mask[p * pixels + i]) plane[i] = NaN;
    }
  });
}
