// A slider of a parameter of the scene.

import { short } from "./texts.js";

// Decimals of a slider: some three hundred places from end to end.
const stepOf = (slider) => 10 ** Math.floor(Math.log10((slider.high - slider.low) / 300));

// A label with a slider in it; changed is called with each new value.
export function sliderOf(slider, value, changed) {
  const label = document.createElement("label");
  label.className = "slide";
  label.htmlFor = `p-${slider.name}`; // else it would be the label of the output in it
  if (slider.about) label.title = slider.about;
  const output = document.createElement("output");
  const span = document.createElement("span");
  span.append(slider.label, output);
  const input = document.createElement("input");
  Object.assign(input, { id: label.htmlFor, type: "range", min: slider.low, max: slider.high, step: "any", value });
  input.dataset.name = slider.name;
  const step = stepOf(slider);
  output.textContent = short(value);
  let now = value;
  const set = (to) => {
    const near = Math.abs(to - slider.value) < 3 * step; // the scene's own value is easy to find again
    now = near ? slider.value : Number((Math.round(to / step) * step).toPrecision(8));
    output.textContent = short(now);
    changed(now);
  };
  input.addEventListener("input", () => set(Number(input.value)));
  // With step "any" arrow keys would move it by one unit of the parameter.
  input.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!by) return;
    event.preventDefault();
    const to = Math.min(Math.max(now + 4 * by * step, slider.low), slider.high);
    set(to);
    input.value = now;
  });
  label.append(span, input);
  return label;
}
