// Pages in frames, the explorer and the animations, have the theme that the reader chose for the site.
function tellTheme(frame) {
  frame.contentWindow?.postMessage({ theme: document.body.dataset.theme || "auto" }, "*");
}

window.addEventListener("DOMContentLoaded", () => {
  const frames = document.querySelectorAll("iframe.explorer, iframe.animation");
  for (const frame of frames) frame.addEventListener("load", () => tellTheme(frame));
  new MutationObserver(() => frames.forEach(tellTheme)).observe(document.body, { attributeFilter: ["data-theme"] });
  frames.forEach(tellTheme);
});
