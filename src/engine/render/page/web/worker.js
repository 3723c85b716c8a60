// The program itself in a worker of the page: WebAssembly, as src/web/lib.rs has it.

let engine, reading = '';

const bytesAt = (start, bytes) => new Uint8Array(engine.memory.buffer, start >>> 0, bytes), textAt = (start, bytes) => new TextDecoder().decode(bytesAt(start, bytes));

// What the program calls.
const page = {
  // Reads bytes of a file elsewhere. Says 1 if that fails, and why in `reading`.
  read_far(offset, out, bytes) {
    try {
      bytesAt(out, bytes).set(rangeOf(self.file, offset, bytes));
      return 0;
    } catch (error) {
      reading = error.message;
      return 1;
    }
  },
  problem(out, most) {
    const text = new TextEncoder().encode(reading).subarray(0, most);
    bytesAt(out, text.length).set(text);
    return text.length;
  },
  panicked(start, bytes) { self.panic = textAt(start, bytes); },
};

// Bytes of a file, by a request that this worker waits for.
function rangeOf({ url, length, name }, offset, bytes) {
  const request = new XMLHttpRequest();
  request.open('GET', url, false);
  request.responseType = 'arraybuffer';
  request.setRequestHeader('Range', `bytes=${offset}-${offset + bytes - 1}`);
  try { request.send(); } catch { throw new Error(`${name}: its host does not answer, or does not let this page read it (CORS), or sends it elsewhere`); }
  const found = new Uint8Array(request.response ?? 0), whole = request.getResponseHeader('Content-Range')?.split('/')[1];
  if (request.status === 200) throw new Error(`${name}: its host sends whole files only; this page needs ranges of bytes`);
  if (request.status !== 206) throw new Error(`${name}: its host answers ${request.status}`);
  if (Number(whole) && Number(whole) !== length) throw new Error(`${name}: has changed since this page was made: ${length} bytes, now ${whole}`);
  if (found.length !== bytes) throw new Error(`${name}: its host sends ${found.length} bytes instead of ${bytes}`);
  return found;
}

function given(bytes) {
  const start = engine.reserve(bytes.length);
  bytesAt(start, bytes.length).set(bytes);
  return [start, bytes.length];
}

// An answer that says what is wrong. After any other error, the program is in no known state.
class Refusal extends Error {}

// The answer to a question, in bytes.
function ask(name, body) {
  const isError = engine.ask(...given(new TextEncoder().encode(name)), ...given(body));
  if (isError) throw new Refusal(textAt(engine.answer(), engine.answer_bytes()));
  return bytesAt(engine.answer(), engine.answer_bytes()).slice();
}

const json = value => new TextEncoder().encode(JSON.stringify(value));

async function begin({ module, memory, file: { bytes, request, ...file } }) {
  self.file = file;
  engine = (await WebAssembly.instantiate(module, { page })).exports;
  if (bytes) ask('bytes', bytes);
  ask('open', json({ name: file.name, far: bytes ? null : file.length, memory, request }));
}

self.onmessage = async ({ data: { begins, name, body } }) => {
  try {
    const answer = begins ? await begin(begins) : ask(name, body);
    self.postMessage({ answer }, answer ? [answer.buffer] : []);
  } catch (error) {
    const isBroken = !(error instanceof Refusal);
    self.postMessage({ error: isBroken ? `the program of this page stopped, perhaps for lack of memory: ${self.panic ?? error.message}` : error.message, isBroken });
  }
};
