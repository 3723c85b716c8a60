// The time line: a slider over the frames with their times, what is loaded, and playing.

class TimeLine {
  constructor(player) {
    this.player = player;
    this.isPlaying = false;
    const on = (id, event, action) => element(id).addEventListener(event, action);
    on('play', 'click', () => this.play(!this.isPlaying));
    on('frame', 'input', () => player.show(Number(element('frame').value)));
    new ResizeObserver(() => this.mark()).observe(element('line'));
  }

  get last() { return this.player.pictures.length - 1; }

  label(index) {
    const { about, pictures } = this.player, { frame } = pictures[index];
    return about.labels[frame] ?? `frame ${frame}`;
  }

  begin() {
    element('frame').max = this.last;
    element('time').hidden = this.last === 0;
    this.mark();
  }

  // Writes the times of some frames under the line, as many as have room.
  mark() {
    if (!this.player.about || !this.last) return;
    const { last } = this, letters = Math.max(...[0, last].map(index => this.label(index).length)), line = element('time-ticks').clientWidth;
    const wide = last * (7 * letters + 8) / Math.max(line, 1), step = roundStep(Math.max(1.2 * wide, 1)), marks = [0]; // widths in frames
    for (let index = step; index < last; index += step) {
      if (index >= 1.5 * wide && index <= last - 1.5 * wide) marks.push(index); // the texts at both ends stand within the line
    }
    const texts = (last < 2 * wide ? [0] : [...marks, last]).map(index => textAt(this.label(index).replace(/^(frame|t =) /, ''), index / last));
    element('time-ticks').replaceChildren(...texts);
  }

  // Follows the picture that is wanted.
  follow(index) {
    const text = this.label(index);
    element('frame').value = index;
    element('frame').ariaValueText = text;
    element('label').textContent = text;
  }

  // Marks the frames whose pictures are loaded.
  showLoaded(isLoaded) {
    const strip = element('loaded'), context = strip.getContext('2d');
    strip.width = Math.min(this.last + 1, 1024);
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--accent');
    for (let x = 0; x < strip.width; x++) if (isLoaded(Math.floor((x + 0.5) / strip.width * (this.last + 1)))) context.fillRect(x, 0, 1, 1);
  }

  play(isPlaying) {
    this.isPlaying = isPlaying;
    const button = element('play');
    button.ariaLabel = isPlaying ? 'Pause' : 'Play';
    button.querySelector('use').setAttribute('href', isPlaying ? '#i-pause' : '#i-play');
    if (isPlaying) this.run();
    else this.player.show(); // as good as it can be
  }

  // Shows one picture after another, each only after the one before it has loaded.
  async run() {
    const { player } = this, run = this.running = {};
    let due = performance.now();
    while (this.isPlaying && this.running === run) {
      if (player.index === this.last && !element('loop').checked) return this.play(false);
      await player.show(player.index === this.last ? 0 : player.index + 1);
      due = Math.max(due + 1000 / (player.about.fps * element('speed').value), performance.now());
      await new Promise(next => setTimeout(next, due - performance.now()));
    }
  }
}

// The least round step that is not below a number.
function roundStep(least) {
  const unit = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(n => n * unit).find(step => step >= least);
}
