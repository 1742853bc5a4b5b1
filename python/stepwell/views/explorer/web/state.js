// What a link holds: everything after the # of the page's address.

// The words of a link as an object; numbers stay texts.
export function parse(hash) {
  const found = {};
  for (const [name, value] of new URLSearchParams(hash.replace(/^#/, ""))) found[name] = value;
  return found;
}

// Numbers are written by their shortest text, which gives the same bits when it is read.
export function format(state) {
  const words = new URLSearchParams();
  for (const [name, value] of Object.entries(state)) if (value !== undefined && value !== null) words.set(name, String(value));
  return `#${words}`;
}

// A finite number within bounds, or another.
export function number(text, low, high, otherwise) {
  const value = text === undefined || text === "" ? NaN : Number(text);
  return Number.isFinite(value) ? Math.min(Math.max(value, low), high) : otherwise;
}
