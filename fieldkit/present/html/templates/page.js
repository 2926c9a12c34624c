"use strict";
// Dates of a map: show the chosen group, hide the others.
for (const figure of document.querySelectorAll("[data-switch]")) {
  const choices = figure.querySelectorAll(".choice");
  figure.addEventListener("change", (event) => {
    choices.forEach((choice, index) => choice.classList.toggle("hidden", String(index) !== event.target.value));
  });
}
