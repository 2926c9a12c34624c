"use strict";
// Dates of a map: show the chosen group, hide the others.
for (const figure of document.querySelectorAll("[data-switch]")) {
  const choices = figure.querySelectorAll(".choice");
  figure.addEventListener("change", (event) => {
    choices.forEach((choice, index) => choice.classList.toggle("hidden", String(index) !== event.target.value));
  });
}
// What is folded away is printed unfolded.
const folded = [];
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details:not([open])")) {
    details.open = true;
    folded.push(details);
  }
});
addEventListener("afterprint", () => {
  for (const details of folded.splice(0)) details.open = false;
});
