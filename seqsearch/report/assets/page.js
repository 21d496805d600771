// Puts the drawings into the page; each finds its place or is left out.
function copying() {
  const line = byId("sequence");
  const button = byId("copy");
  button.hidden = false;
  button.addEventListener("click", () => {
    const done = () => { byId("copied").textContent = "copied"; };
    const byHand = () => {
      const range = document.createRange();
      range.selectNodeContents(line);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      if (document.execCommand("copy")) done();
    };
    if (navigator.clipboard) navigator.clipboard.writeText(line.textContent).then(done, byHand);
    else byHand();
  });
}

copying();
if (byId("space")) {
  const ecliptic = byId("ecliptic");
  const space = byId("space");
  const view = Object.assign({}, FROM_ABOVE, START);
  let [flat, deep] = [[], []];
  const show = () => { deep = drawSpace(space, view, false); };
  drawn(ecliptic, () => { flat = drawSpace(ecliptic, FROM_ABOVE, true); });
  drawn(space, show);
  turnable(space, view, show);
  pointable(ecliptic, () => flat);
  pointable(space, () => deep);
  drawn(byId("thrust"), (width) => drawThrust(byId("thrust"), width));
  drawn(byId("mass"), (width) => drawMass(byId("mass"), width));
  drawn(byId("visits"), (width) => drawVisits(byId("visits"), width));
}
if (byId("ranks")) {
  const select = byId("pass");
  const passes = [...new Set(data.ranks.map((line) => line[0]))];
  for (const pass of passes.length > 1 ? ["all", ...passes] : passes) {
    const option = document.createElement("option");
    option.value = String(pass);
    option.textContent = String(pass);
    select.appendChild(option);
  }
  drawn(byId("ranks"), (width) => drawRanks(byId("ranks"), width, select.value));
  select.addEventListener("change", () => drawRanks(byId("ranks"), byId("ranks").clientWidth, select.value));
}
if (byId("candidates")) drawn(byId("candidates"), (width) => drawCandidates(byId("candidates"), width));
document.documentElement.setAttribute("data-drawn", "yes");
