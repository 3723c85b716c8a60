// The state of the page in its address, which a reload or a link brings back. What makes no sense there is left out.

const Address = {
  read() {
    return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
  },

  // Writes the fields that have a value.
  write(state) {
    if (this.isLeft) return;
    const known = Object.entries(state).filter(([, value]) => value !== null && value !== undefined && value !== '');
    this.text = known.map(([name, value]) => `${name}=${encodeURIComponent(value).replace(/%2C/g, ',').replace(/%3A/g, ':')}`).join('&');
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      try { history.replaceState(null, '', `#${this.text}`); } catch { /* a page within another has no address of its own */ }
    }, 150);
  },

  link() {
    return `${location.href.split('#')[0]}#${this.text ?? ''}`;
  },
};

// A link that is opened in the same tab changes only the state.
addEventListener('hashchange', () => {
  clearTimeout(Address.waiting);
  Address.isLeft = true;
  location.reload();
});

// Numbers that are separated by commas, if there are so many; else nothing.
function numbersIn(text, count) {
  const all = (text ?? '').split(',').map(part => part.trim() === '' ? NaN : Number(part));
  return all.length === count && all.every(Number.isFinite) ? all : null;
}

const natural = text => /^\d{1,9}$/.test(text ?? '') ? Number(text) : null;
