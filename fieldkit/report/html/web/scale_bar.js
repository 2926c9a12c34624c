// A bar of a round length: only from above are all lengths in the picture to one scale.

import { niceStep } from "./marks.js";

const MOST_BARS = 7; // in the picture's width

export class ScaleBar {
  // `words`: of a length.
  constructor(stage, words) {
    this.words = words;
    this.bar = document.createElement("div");
    this.bar.className = "fk-view-length";
    this.bar.hidden = true;
    stage.append(this.bar);
  }

  // Takes the pixels of a metre, and the picture's width in pixels; no pixels hide the bar.
  show(perMetre, width) {
    this.bar.hidden = !perMetre;
    if (!perMetre) return;
    const length = niceStep(width / perMetre, MOST_BARS);
    this.bar.style.width = `${length * perMetre}px`;
    this.bar.textContent = this.words(length);
  }
}

// A length in words; without metres in units of the reconstruction's own.
export function lengthWords(length, metric) {
  if (!metric) return `${Number(length.toPrecision(2))} units`;
  if (length < 0.01) return `${Number((1000 * length).toPrecision(2))} mm`;
  return length < 1 ? `${Number((100 * length).toPrecision(2))} cm` : `${Number(length.toPrecision(2))} m`;
}
