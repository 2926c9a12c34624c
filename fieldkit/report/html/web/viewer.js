// Finds the page's 3D views and starts each when it is scrolled near.

import { View } from "./view.js";

const MOST_STARTED = 6; // of the about sixteen WebGL contexts that browsers keep in a page

function begin() {
  const views = new Map();
  const seen = [];
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const view = views.get(target);
      view.near = isIntersecting;
      if (!isIntersecting) continue;
      const at = seen.indexOf(view);
      if (at >= 0) seen.splice(at, 1);
      seen.push(view);
      if (target.dataset.state === "lost") view.suspend(); // and then tried again
      view.start();
    }
    for (const view of seen.slice(0, Math.max(0, seen.length - MOST_STARTED))) {
      if (view.near || view.starting) continue;
      view.suspend();
      seen.splice(seen.indexOf(view), 1);
    }
  }, { rootMargin: "400px 0px" });
  for (const figure of document.querySelectorAll(".fk-view")) {
    const view = new View(figure);
    figure.fieldkitView = view; // for tests and for what else a page wants to do
    views.set(figure, view);
    observer.observe(figure);
  }
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
else begin();
