(selector) => {
  // Record every displacement of the controls that match and of the Stop dock, and everything that covers them, frame by frame.
  // A list that scrolls inside the pad hides some of its buttons: these are not watched.
  const shown = (element) => {
    const box = element.getBoundingClientRect();
    for (let each = element.parentElement; each; each = each.parentElement) {
      if (getComputedStyle(each).overflow === "visible") continue;
      const clip = each.getBoundingClientRect();
      if (box.top < clip.top || box.bottom > clip.bottom || box.left < clip.left || box.right > clip.right) return false;
    }
    return true;
  };
  const pad = [...document.querySelectorAll(selector)].filter(shown);
  const watched = [...pad, ...document.querySelectorAll(".dock, .stop")];
  const start = watched.map((element) => element.getBoundingClientRect());
  const faults = new Set();
  const name = (element) => (element.getAttribute("aria-label") || element.className || element.tagName).trim().slice(0, 60);
  const check = () => {
    watched.forEach((element, index) => {
      const before = start[index];
      const box = element.getBoundingClientRect();
      const moved = ["left", "top", "width", "height"].filter((side) => box[side] !== before[side]);
      for (const side of moved) faults.add(`${name(element)}: ${side} ${before[side]} -> ${box[side]} px`);
      if (element.matches(".dock")) return;
      for (const x of [0.1, 0.5, 0.9]) {
        for (const y of [0.1, 0.5, 0.9]) {
          const top = document.elementFromPoint(before.left + x * before.width, before.top + y * before.height);
          if (!element.contains(top)) faults.add(`${name(element)}: covered by ${top ? name(top) : "the edge of the screen"}`);
        }
      }
    });
    window.padFrames++;
    window.padWatch = requestAnimationFrame(check);
  };
  cancelAnimationFrame(window.padWatch);
  window.padFrames = 0;
  window.padFaults = () => {
    cancelAnimationFrame(window.padWatch);
    return [...faults];
  };
  check();
  return pad.length;
}
