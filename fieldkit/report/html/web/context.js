// What draws, or why nothing can.

import { WebGLRenderer } from "three";

// Throws an error whose `fieldkit` is a sentence for people.
export function newRenderer() {
  const sorry = (text) => Object.assign(new Error(text), { fieldkit: text });
  if (typeof DecompressionStream === "undefined") {
    throw sorry("This browser is too old for the 3D view: it needs Chrome or Edge 80, Firefox 113, Safari 16.4, or "
      + "newer.");
  }
  const canvas = document.createElement("canvas");
  canvas.setAttribute("aria-hidden", "true");
  const options = { alpha: true, antialias: true, powerPreference: "high-performance" };
  const context = canvas.getContext("webgl2", options);
  if (!context) {
    throw sorry("The 3D view needs WebGL 2, which this browser does not offer here. Hardware acceleration may be "
      + "switched off in its settings.");
  }
  return new WebGLRenderer({ canvas, context, ...options });
}
