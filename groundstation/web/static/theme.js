// Light or dark as chosen here before, else as the system has it. Runs before the first paint.
(() => {
  const chosen = localStorage.getItem("echelon.theme");
  if (chosen) document.documentElement.dataset.theme = chosen;
})();
