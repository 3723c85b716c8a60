// Answers by a server, that of `wavesplat view`.

const SLOW = 30e6; // bytes per second below which answers are packed

class Server {
  constructor() {
    this.isSlow = false; // whether answers should be packed
    this.blockTime = 1500; // milliseconds that a block of full pictures may take
  }

  // The answer to a question, in bytes.
  async ask(name, body, { signal } = {}) {
    const answer = await this.patiently(name, { method: 'POST', body: JSON.stringify(body), signal });
    if (!answer.ok) throw new Error(await answer.text() || answer.statusText);
    const started = performance.now(), bytes = new Uint8Array(await answer.arrayBuffer());
    if (bytes.length > 2 ** 20 && bytes.length / (performance.now() - started) * 1000 < SLOW) this.isSlow = true;
    return bytes;
  }

  // Asks until the server answers.
  async patiently(where, options) {
    for (let isBack = false; ; isBack = true) {
      try {
        const answer = await fetch(where, options);
        if (isBack) say('status', '');
        return answer;
      } catch (error) {
        if (options.signal?.aborted || !(error instanceof TypeError)) throw error;
        say('status', 'wavesplat view does not answer. If it has ended, start it again.');
        await pause(1000);
      }
    }
  }

  // How much of its work is done, 0 to 1; null if nobody knows, undefined if it does not answer.
  async progress() {
    const text = await fetch('progress').then(answer => answer.ok ? answer.text() : '').catch(() => '');
    return text ? Number(text) : undefined;
  }
}
