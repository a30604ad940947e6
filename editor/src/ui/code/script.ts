/** The content of a generated script: its actions by line, the folded parts, ids. Pure functions. */

/** A range of characters. */
export interface Range {
  from: number;
  to: number;
}

/** An action that a script calls: its name, and the range of the call's lines. */
export interface ScriptAction extends Range {
  name: string;
}

const ACTION_NAME = /\ban\s*=\s*("(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')/g;
const ID = /\b[a-z]{3}_[0-9a-f]{32}\b/g;

/** Return the text of a Python string literal without prefix. */
const unquoted = (literal: string): string => literal.slice(1, -1).replace(/\\(["'\\])/g, "$1");

/** Return the start of the call that contains a position: its opening bracket; the position itself without one. */
function openingBracket(source: string, at: number): number {
  let depth = 0;
  for (let each = at - 1; each >= 0; each--) {
    const character = source[each];
    if (character === ")") depth++;
    else if (character === "(" && depth-- === 0) return each;
  }
  return at;
}

/** Return the actions of a script in their order: the script passes their names as `an`. */
export function actionsOf(source: string): ScriptAction[] {
  return [...source.matchAll(ACTION_NAME)].map((found) => ({
    name: unquoted(found[1] ?? ""),
    from: source.lastIndexOf("\n", openingBracket(source, found.index)) + 1,
    to: found.index + found[0].length,
  }));
}

/** Return the ids in a script, which users see as names. */
export function idsOf(source: string): (Range & { id: string })[] {
  return [...source.matchAll(ID)].map((found) => ({
    id: found[0],
    from: found.index,
    to: found.index + found[0].length,
  }));
}

/** Return the range from the end of the first to the end of the last of these lines; null for fewer than two. */
function foldOf(source: string, first: RegExp, following: RegExp): Range | null {
  const start = first.exec(source);
  if (!start) return null;
  const from = start.index + start[0].length;
  let to = from;
  for (let next = to; source[next] === "\n"; ) {
    const end = source.indexOf("\n", next + 1);
    const line = source.slice(next + 1, end === -1 ? source.length : end);
    if (!following.test(line)) break;
    next = end === -1 ? source.length : end;
    if (line.trim()) to = next;
  }
  return to > from ? { from, to } : null;
}

/** Return the parts of a script that are the same in every program: imports, objects of the scene and entry point. */
export function boilerplate(source: string): Range[] {
  return [
    foldOf(source, /^from .*$/m, /^(from .*|)$/),
    foldOf(source, /^ +# Objects of the scene$/m, /^ +\w+: [\w.]+ = res\.objects\[.*\]$/),
    foldOf(source, /^if __name__ == .*$/m, /^( .*|)$/),
  ].filter((each) => each !== null);
}
