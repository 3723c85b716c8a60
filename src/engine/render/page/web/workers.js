// Answers by the program itself, in two workers of the page: one for coarse pictures, which show at once, and one for all else.

// Milliseconds that work which nobody wants may still take, until another worker takes the place: longer if what it read is lost.
const GRACE = 200, GRACE_FAR = 3000;

class Workers {
  // The program and the file are packed, in elements of the page or beside it.
  constructor(file) {
    this.blockTime = 300; // milliseconds that a block of full pictures may take: nothing stops it
    this.together = 1; // frames that are asked for together while nobody waits
    this.keptBytes = 128 * 2 ** 20; // of pictures: with the workers, the page takes less than 1 GB
    const hand = memory => new Hand(file.url ? GRACE_FAR : GRACE, async () => {
      this.ready ??= this.read(file);
      this.ready.catch(() => { this.ready = null; }); // the next question tries again
      const { source, ...parts } = await this.ready;
      return { source, begins: { memory, ...parts } };
    });
    [this.coarse, this.full] = file.memory.map(hand);
  }

  // The program, and the file or where it is.
  async read({ name, length, request, url, program }) {
    const far = url && new URL(url, location.href).href, packed = program ? await fetched(program) : bytesOf(await textOfPart('program', 'file'));
    const module = await WebAssembly.compile(await inflated(packed)), text = far ? null : await textOfPart('file');
    if (!far && text.length !== 4 * Math.ceil(length / 3)) throw incomplete(name);
    const bytes = far ? null : bytesOf(text);
    element('file')?.remove(); // its text takes memory
    this.source ??= URL.createObjectURL(new Blob([await textOfPart('worker')], { type: 'text/javascript' }));
    return { source: this.source, module, file: { name, length, request, url: far, bytes } };
  }

  ask(name, body, { signal, isCoarse } = {}) {
    return (isCoarse ? this.coarse : this.full).ask(name, new TextEncoder().encode(JSON.stringify(body)), signal);
  }

  async progress() { return null; }
}

// The text of a part of the page, as soon as the browser has read it: up to the next part, or all of the page.
async function textOfPart(id, next) {
  while (document.readyState === 'loading' && !(next && element(next))) await pause(5);
  const part = element(id);
  if (!part || next && !element(next)) throw incomplete(`the ${id}`);
  return part.textContent;
}

const incomplete = what => new Error(`${what} is incomplete: get this page again`);

async function fetched(address) {
  const answer = await fetch(address).catch(() => null);
  if (answer?.ok) return new Uint8Array(await answer.arrayBuffer());
  throw new Error(answer ? `${address}: the host answers ${answer.status}` : `${address} cannot be read: this folder opens from a server, not from the disk; or the server does not answer`);
}

// A worker that answers one question after another. Nothing interrupts it: if it works too long on what nobody wants, another
// one takes its place.
class Hand {
  constructor(grace, begins) {
    Object.assign(this, { grace, begins });
    this.questions = []; // those that wait, and the one that is asked
    this.asked = null;
  }

  ask(name, body, signal) {
    return new Promise((resolve, reject) => {
      const question = { name, body, resolve, reject };
      signal?.addEventListener('abort', () => this.drop(question));
      this.questions.push(question);
      this.go();
    });
  }

  drop(question) {
    question.isDropped = true;
    question.reject(new DOMException('nobody waits any more', 'AbortError'));
    if (question !== this.asked) this.questions = this.questions.filter(other => other !== question);
    this.go();
  }

  // Asks the first question that waits. If nobody wants the one that is asked, it waits no longer than a while.
  go() {
    const { asked } = this;
    if (!asked) this.next();
    else if (asked.isDropped && this.questions.length > 1) setTimeout(() => { if (this.asked === asked && this.questions.length > 1) this.restart(); }, this.grace);
  }

  async next() {
    if (this.isStarting || !this.questions.length) return;
    if (!this.worker) await this.start();
    const { worker, questions: [question] } = this;
    if (!worker || !question || this.asked) return;
    this.asked = question;
    const { answer, error, isBroken } = await answerOf(worker, { name: question.name, body: question.body });
    if (worker !== this.worker) return;
    if (error === undefined) question.resolve(answer);
    else question.reject(new Error(error));
    if (isBroken) return this.restart();
    this.end();
  }

  end() {
    this.questions = this.questions.filter(question => question !== this.asked);
    this.asked = null;
    this.next();
  }

  restart() {
    this.worker?.terminate();
    this.worker = null;
    this.end();
  }

  // Starts a worker. If it does not start, all questions fail, and the next one tries again.
  async start() {
    this.isStarting = true;
    let worker;
    try {
      const { source, begins } = await this.begins();
      worker = new Worker(source);
      const { error } = await answerOf(worker, { begins });
      if (error !== undefined) throw new Error(error);
      this.worker = worker;
    } catch (error) {
      worker?.terminate();
      this.questions.splice(0).forEach(question => question.reject(error));
    }
    this.isStarting = false;
  }
}

// What a worker answers to a message.
function answerOf(worker, message) {
  return new Promise(resolve => {
    worker.onmessage = ({ data }) => resolve(data);
    worker.onerror = worker.onmessageerror = event => resolve({ error: event.message ?? 'the worker of this page does not answer', isBroken: true });
    worker.postMessage(message);
  });
}
