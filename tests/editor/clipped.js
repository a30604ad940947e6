() => {
  // Texts of controls and headings that do not fit into their boxes. Names of data may be shortened.
  const shown = (element) => {
    const box = element.getBoundingClientRect();
    return element.checkVisibility({ visibilityProperty: true }) && box.width > 1 && box.height > 1;
  };
  const scope = [...document.querySelectorAll(".overlay, .popover")].at(-1) ?? document;
  const texts = "button, label, summary, legend, h1, h2, h3, dt, .tag, .tab, [role=tab], [role=menuitem], [role=option]";
  return [...scope.querySelectorAll(texts)]
    .filter((element) => shown(element) && !element.closest(".hidden-but-read, [data-name]"))
    .filter((element) => getComputedStyle(element).display !== "inline")
    .filter((element) => element.scrollWidth > element.clientWidth + 1 || element.scrollHeight > element.clientHeight + 2)
    .map((element) => {
      const { scrollWidth, clientWidth, scrollHeight, clientHeight, className } = element;
      const text = element.textContent.trim().slice(0, 60);
      return `${element.tagName}.${className} “${text}”: ${scrollWidth}×${scrollHeight} in ${clientWidth}×${clientHeight}`;
    });
}
