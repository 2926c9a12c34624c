"use strict";
// Figure and date of a map: show what is chosen, hide the others.
for (const figure of document.querySelectorAll("[data-switch]")) {
  const shown = (name, value) => {
    const chosen = figure.querySelector(`input[name$="-${name}"]:checked`);
    return value === undefined || chosen === null || chosen.value === value;
  };
  figure.addEventListener("change", () => {
    for (const { classList, dataset } of figure.querySelectorAll(".choice")) {
      classList.toggle("hidden", !(shown("measure", dataset.measure) && shown("date", dataset.date)));
    }
  });
}
