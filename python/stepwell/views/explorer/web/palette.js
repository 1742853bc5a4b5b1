// Colours of the page's style sheet and of methods, for canvases; and canvases as sharp as the screen.

export function palette() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    dark: of("scheme") === "dark",
    text: of("text"),
    faint: of("faint"),
    line: of("line"),
    truth: of("truth"),
    bad: of("bad"),
    surface: of("surface"),
    font: `12px ${of("font")}`,
  };
}

// A method's colour; on a dark page one that is too dark becomes lighter.
export function colourOf(method, dark) {
  const channels = [1, 3, 5].map((i) => parseInt(method.colour.slice(i, i + 2), 16) / 255);
  if (!dark) return method.colour;
  const light = 0.2126 * channels[0] ** 2.2 + 0.7152 * channels[1] ** 2.2 + 0.0722 * channels[2] ** 2.2;
  const share = Math.min(0.8, Math.max(0, 0.8 - 2.2 * light));
  return `rgb(${channels.map((x) => Math.round(255 * (x + (1 - x) * share))).join(" ")})`;
}

// Black or white, whichever is read more easily on a colour.
export function inkOn(colour) {
  const channels = colour.startsWith("#") ? [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16)) : colour.match(/\d+/g).map(Number);
  const [r, g, b] = channels.map((x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#000000" : "#ffffff"; // the light at which both have the same contrast
}

// The context of a canvas, cleared, in CSS pixels, and its size in these.
export function sheet(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 3);
  // A page that is not shown has no size; what is drawn on it needs one.
  const width = Math.max(canvas.clientWidth, 60);
  const height = Math.max(canvas.clientHeight, 60);
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineJoin = "round";
  pen.lineCap = "round";
  return { pen, width, height };
}
