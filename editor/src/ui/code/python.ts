/** Split Python into tokens for highlighting: keywords, strings, numbers, comments. */

export interface Piece {
  text: string;
  kind: "plain" | "word" | "text" | "number" | "comment" | "name";
}

const KEYWORDS: ReadonlySet<string> = new Set(
  (
    "and as assert async await break class continue def del elif else except finally for from global " +
    "if import in is lambda None nonlocal not or pass raise return True False try while with yield"
  ).split(" "),
);
const TOKENS =
  /(#.*$)|("""[\s\S]*?"""|'''[\s\S]*?'''|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')|(\b\d[\d._e+-]*\b)|([A-Za-z_]\w*)/gm;

/** Lines of tokens; a string over several lines has a token in each. */
export function pieces(source: string): Piece[][] {
  const lines: Piece[][] = [[]];
  const add = (text: string, kind: Piece["kind"]) => {
    text.split("\n").forEach((part, index) => {
      if (index > 0) lines.push([]);
      if (part) lines.at(-1)?.push({ text: part, kind });
    });
  };
  let at = 0;
  for (const found of source.matchAll(TOKENS)) {
    if (found.index > at) add(source.slice(at, found.index), "plain");
    const [text, comment, string, number] = found;
    add(
      text,
      comment !== undefined
        ? "comment"
        : string !== undefined
          ? "text"
          : number !== undefined
            ? "number"
            : KEYWORDS.has(text)
              ? "word"
              : "name",
    );
    at = found.index + text.length;
  }
  add(source.slice(at), "plain");
  return lines;
}
