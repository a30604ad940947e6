(smallest) => {
  // What is wrong with where things are: too small to be touched, covered, off the screen, overlapping.
  const faults = [];
  const shown = (element) => {
    const style = getComputedStyle(element);
    const box = element.getBoundingClientRect();
    return (
      style.visibility !== "hidden" &&
      style.display !== "none" &&
      box.width > 1 &&
      box.height > 1 &&
      !element.closest(".hidden-but-read") &&
      !onlyRead(element)
    );
  };
  // What is there for screen readers alone.
  const onlyRead = (element) => {
    for (let each = element; each; each = each.parentElement) {
      if (getComputedStyle(each).clipPath.startsWith("inset(50%")) return true;
    }
    return false;
  };
  // Below a window nothing can be touched.
  const scope = [...document.querySelectorAll(".overlay")].at(-1) ?? document;
  const name = (element) =>
    (element.getAttribute("aria-label") || element.textContent || element.tagName).trim().slice(0, 40);
  const touched = [
    ...scope.querySelectorAll(
      "button, input, select, textarea, a[href], [role=tab], [role=option], [role=menuitem], summary",
    ),
  ].filter((element) => shown(element) && !element.closest("[aria-hidden=true]"));
  for (const element of touched) {
    const box = element.getBoundingClientRect();
    const area = element.matches("input[type=checkbox]") ? element.closest("label").getBoundingClientRect() : box;
    if (Math.min(area.width, area.height) < smallest - 0.5) {
      faults.push(`${name(element)}: ${Math.round(area.width)} x ${Math.round(area.height)} px`);
    }
    if (element.closest(".panel-body, .home > main, .dialog")) continue; // these scroll
    if (box.left < -1 || box.top < -1 || box.right > innerWidth + 1 || box.bottom > innerHeight + 1) {
      faults.push(`${name(element)}: off the screen`);
      continue;
    }
    const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    if (top && !element.contains(top) && !top.contains(element)) {
      faults.push(`${name(element)}: covered by ${name(top)}`);
    }
  }
  if (document.documentElement.scrollWidth > innerWidth + 1) faults.push("the page scrolls sideways");
  const labels = [...document.querySelectorAll(".view-label")]
    .filter(shown)
    .map((element) => [name(element), element.getBoundingClientRect()]);
  if (labels.length > 8) faults.push(`${labels.length} labels`);
  labels.forEach(([a, p], index) => {
    for (const [b, q] of labels.slice(index + 1)) {
      const over = p.left < q.right && q.left < p.right && p.top < q.bottom && q.top < p.bottom;
      if (over) faults.push(`labels ${a} and ${b} overlap`);
    }
  });
  return faults;
}
