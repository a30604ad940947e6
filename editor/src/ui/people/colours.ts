/** A colour per user, the same on every device; dark enough for white letters. */

const COLOURS = ["#0b5c8a", "#8a3b0b", "#5b3b9c", "#0f6b46", "#9c2b57", "#5c5a00", "#7a2e2e", "#2f4f9c"];

export function colourOf(name: string): string {
  let sum = 0;
  for (const letter of name) sum = (sum * 31 + (letter.codePointAt(0) ?? 0)) >>> 0;
  return COLOURS[sum % COLOURS.length] ?? "#0b5c8a";
}

export function initials(name: string): string {
  const words = name.split(/[\s_.-]+/).filter(Boolean);
  const letters =
    words.length > 1
      ? [words[0], words[words.length - 1]].map((word) => [...(word ?? "")][0])
      : [...(words[0] ?? "?")].slice(0, 2);
  return letters.join("").toUpperCase();
}
