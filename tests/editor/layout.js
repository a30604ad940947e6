(smallest) => {
  // What is wrong with where things are: too small to be touched, covered, off the screen, overlapping.
  const faults = [];
  const shown = (element) => {
    const box = element.getBoundingClientRect();
    return (
      // False in a closed <details>, too, whose content has a box.
      element.checkVisibility({ visibilityProperty: true }) &&
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
  // The part of an element's box that its scrolling ancestors show.
  const visibleBox = (element) => {
    let { left, top, right, bottom } = element.getBoundingClientRect();
    for (let each = element; each.parentElement && getComputedStyle(each).position !== "fixed"; each = each.parentElement) {
      if (getComputedStyle(each.parentElement).overflow === "visible") continue;
      const clip = each.parentElement.getBoundingClientRect();
      left = Math.max(left, clip.left);
      top = Math.max(top, clip.top);
      right = Math.min(right, clip.right);
      bottom = Math.min(bottom, clip.bottom);
    }
    return { left, top, right, bottom };
  };
  const overlap = (p, q) =>
    Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1 && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 1;
  // No control reaches into the Stop dock, on any layer of the page, and nothing covers the Stop button.
  const stopFaults = () => {
    const stop = document.querySelector(".stop");
    if (!stop) return [];
    const found = [];
    const dock = stop.closest(".dock");
    const button = stop.getBoundingClientRect();
    if (!dock) found.push("Stop has no dock");
    for (const element of document.querySelectorAll(controls)) {
      if (element === stop || !shown(element)) continue;
      const taken = dock?.contains(element) ? button : (dock ?? stop).getBoundingClientRect();
      if (overlap(visibleBox(element), taken)) found.push(`${name(element)}: in the Stop dock`);
    }
    if (stop.scrollHeight > stop.clientHeight || stop.scrollWidth > stop.clientWidth) found.push("Stop: its text is cut off");
    for (const [x, y] of [[0.5, 0.5], [0.05, 0.5], [0.95, 0.5], [0.5, 0.05], [0.5, 0.95]]) {
      const top = document.elementFromPoint(button.left + x * button.width, button.top + y * button.height);
      if (!stop.contains(top)) found.push(`Stop: covered by ${top ? name(top) : "the edge of the screen"}`);
    }
    return found;
  };
  // The number of rows into which a bar has wrapped.
  const rowsOf = (bar) => {
    const boxes = [...(bar?.children ?? [])].filter(shown).map((element) => element.getBoundingClientRect());
    let [rows, bottom] = [0, -Infinity];
    for (const box of boxes.sort((p, q) => p.top - q.top)) {
      if (box.top >= bottom) rows++;
      bottom = Math.max(bottom, box.bottom);
    }
    return rows;
  };
  // Below a dialog or menu nothing can be touched.
  const scope = [...document.querySelectorAll(".overlay, .popover")].at(-1) ?? document;
  const name = (element) =>
    (element.getAttribute("aria-label") || element.textContent || element.tagName).trim().slice(0, 40);
  const controls = "button, input, select, textarea, a[href], [role=tab], [role=option], [role=menuitem], summary";
  const touched = [...scope.querySelectorAll(controls)].filter(
    (element) => shown(element) && !element.closest("[aria-hidden=true]"),
  );
  for (const element of touched) {
    const box = element.getBoundingClientRect();
    const area = element.matches("input[type=checkbox]") ? element.closest("label").getBoundingClientRect() : box;
    if (Math.min(area.width, area.height) < smallest - 0.5) {
      faults.push(`${name(element)}: ${Math.round(area.width)} x ${Math.round(area.height)} px`);
    }
    if (element.closest(".panel-body, .puck-fields, .home > main, .fleet > main, .operator > [data-runs=false] > :not(.alarms), .dialog")) continue; // these scroll
    if (box.left < -1 || box.top < -1 || box.right > innerWidth + 1 || box.bottom > innerHeight + 1) {
      faults.push(`${name(element)}: off the screen`);
      continue;
    }
    const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    if (top && !element.contains(top) && !top.contains(element)) {
      faults.push(`${name(element)}: covered by ${name(top)}`);
    }
  }
  faults.push(...stopFaults());
  const rows = rowsOf(document.querySelector(".topbar"));
  if (rows > 2) faults.push(`the top bar has ${rows} rows`);
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
