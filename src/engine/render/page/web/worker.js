// The program itself in a worker of the page: WebAssembly, as src/web/lib.rs has it.

const ROUNDS = 8; // rounds of reading side by side; a question that needs more reads one part after another

let engine, file, panic, wanted = [], isHurried = false, refused = null;
const there = new Map(); // bytes of the file elsewhere that the program has not taken yet

const bytesAt = (start, bytes) => new Uint8Array(engine.memory.buffer, start >>> 0, bytes), textAt = (start, bytes) => new TextDecoder().decode(bytesAt(start, bytes));
const keyOf = (offset, bytes) => `${offset} ${bytes}`;

// An error that says what is wrong. After any other one, the program is in no known state.
class Refusal extends Error {}

// What the program calls.
const page = {
  has(offset, bytes) {
    if (isHurried) readNow(offset, bytes);
    else if (!there.has(keyOf(offset, bytes))) wanted.push([offset, bytes]);
    return Number(there.has(keyOf(offset, bytes)));
  },
  give(offset, out, bytes) {
    bytesAt(out, bytes).set(there.get(keyOf(offset, bytes)));
    there.delete(keyOf(offset, bytes));
  },
  panicked(start, bytes) { panic = textAt(start, bytes); },
};

// An error unless an answer has just these bytes.
function check(status, contentRange, offset, bytes) {
  const { name, length } = file, [from, whole] = (contentRange ?? '').replace('bytes ', '').split(/-\d+\//).map(Number);
  if (status === 200) throw new Refusal(`${name}: its host sends whole files only; this page needs ranges of bytes`);
  if (status !== 206) throw new Refusal(`${name}: its host answers ${status}`);
  if (whole && whole !== length) throw new Refusal(`${name}: has changed since this page was made: ${length} bytes, now ${whole}`);
  if (from !== offset && contentRange) throw new Refusal(`${name}: its host sends bytes from ${from} on instead of ${offset}`);
}

function keep(found, offset, bytes) {
  if (found.byteLength !== bytes) throw new Refusal(`${file.name}: its host sends ${found.byteLength} bytes instead of ${bytes}`);
  there.set(keyOf(offset, bytes), new Uint8Array(found));
}

const headers = (offset, bytes) => ({ Range: `bytes=${offset}-${offset + bytes - 1}` });
const unread = () => new Refusal(`${file.name}: its host does not answer, or does not let this page read it (CORS), or sends it elsewhere`);

async function read([offset, bytes]) {
  const stop = new AbortController(), answer = await fetch(file.url, { headers: headers(offset, bytes), signal: stop.signal }).catch(() => { throw unread(); });
  try {
    check(answer.status, answer.headers.get('Content-Range'), offset, bytes);
  } catch (error) {
    stop.abort(); // it may be the whole file
    throw error;
  }
  keep(await answer.arrayBuffer().catch(() => { throw unread(); }), offset, bytes);
}

// Reads a part while the program waits.
function readNow(offset, bytes) {
  const request = new XMLHttpRequest();
  request.open('GET', file.url, false);
  request.responseType = 'arraybuffer';
  request.setRequestHeader('Range', headers(offset, bytes).Range);
  try {
    try { request.send(); } catch { throw unread(); }
    check(request.status, request.getResponseHeader('Content-Range'), offset, bytes);
    keep(request.response, offset, bytes);
  } catch (error) { refused = error; }
}

function given(bytes) {
  const start = engine.reserve(bytes.length);
  bytesAt(start, bytes.length).set(bytes);
  return [start, bytes.length];
}

// The answer to a question, in bytes. If it needs more of the file, that is read, and the question is asked again.
async function ask(name, body) {
  there.clear();
  for (let round = 0; ; round++) {
    [wanted, refused, isHurried] = [[], null, round >= ROUNDS];
    const isError = engine.ask(...given(new TextEncoder().encode(name)), ...given(body)), [start, bytes] = [engine.answer(), engine.answer_bytes()];
    if (!isError) return bytesAt(start, bytes).slice();
    if (!wanted.length) throw refused ?? new Refusal(textAt(start, bytes));
    await Promise.all(wanted.map(read));
  }
}

const json = value => new TextEncoder().encode(JSON.stringify(value));

async function begin({ module, memory, file: { bytes, request, ...about } }) {
  file = about;
  engine = (await WebAssembly.instantiate(module, { page })).exports;
  if (bytes) await ask('bytes', bytes);
  await ask('open', json({ name: file.name, far: bytes ? null : file.length, memory, request }));
}

self.onmessage = async ({ data: { begins, name, body } }) => {
  try {
    const answer = begins ? await begin(begins) : await ask(name, body);
    self.postMessage({ answer }, answer ? [answer.buffer] : []);
  } catch (error) {
    const isBroken = !(error instanceof Refusal);
    self.postMessage({ error: isBroken ? `the program of this page stopped, perhaps for lack of memory: ${panic ?? error.message}` : error.message, isBroken });
  }
};
