(names) => {
  // Visible texts and texts for screen readers that are in plain letters, so that they did not come from a catalogue.
  // Exempt are: names and values that users typed or that models and devices define, units, keys, times, code, products.
  const UNITS = "mm|cm|m|km|s|ms|min|h|Hz|kg|g|N|Nm|V|A|mA|Pa|kPa|deg|rad|px|kB|MB|GB|MiB|fps|bit|bar|Ω|X|Y|Z|x|y|z|RX|RY|RZ|Rx|Ry|Rz|J\\d|[a-zA-Z]";
  const OTHER = "/tmp/arcor2-fake-\\w+/tty|ARCOR2-HW|English|Čeština|Deutsch|Python|URDF|TCP|JSON|Modbus|Ctrl|Esc|Shift|Alt|Enter|Tab|true|false";
  const TIMES = "gerade eben|jetzt|vor \\d+ \\S+|gestern|Jan\\.?|Feb\\.?|März|Apr\\.?|Mai|Juni|Juli|Aug\\.?|Sept\\.?|Okt\\.?|Nov\\.?|Dez\\.?|Uhr";
  const ARIA = "Schließen|Reduzieren|Erweitern"; // texts of react-aria, which has its own catalogues
  const exempt = new RegExp(`(?<![\\p{L}\\d_])(${UNITS}|${OTHER}|${TIMES}|${ARIA})(?![\\p{L}_])`, "gu");
  const escaped = names.flatMap((name) => [name, name.replaceAll("_", " ")]).map((name) => name.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&"));
  const named = new RegExp(`(?<![\\p{L}\\d_])(${escaped.join("|")})(?![\\p{L}_])`, "gu");
  const plain = (text) => /[A-Za-z]{2,}/.test(text.replace(named, " ").replace(exempt, " "));
  const shown = (element) => element.checkVisibility({ visibilityProperty: true });
  const inCode = (element) => element.closest("pre, code, kbd, script, style, textarea, .cm-content, .view-label, [data-name]");
  const found = new Set();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const element = node.parentElement;
    const text = node.textContent.trim();
    if (text && !inCode(element) && shown(element) && plain(text)) found.add(`${element.tagName}.${element.className} “${text}”`);
  }
  for (const element of document.querySelectorAll("[aria-label], [placeholder], [title]")) {
    if (inCode(element) || !shown(element)) continue;
    for (const name of ["aria-label", "placeholder", "title"]) {
      const text = element.getAttribute(name);
      if (text && plain(text)) found.add(`${name} of ${element.tagName}.${element.className} “${text}”`);
    }
  }
  return [...found];
}
