/** Selectors that compute an object return the same one as long as nothing changed. */

/** Return a function that computes again only for another input than the last one. */
export function memoized<Input, Result>(compute: (input: Input) => Result): (input: Input) => Result {
  let last: { input: Input; result: Result } | undefined;
  return (input) => {
    if (!last || last.input !== input) last = { input, result: compute(input) };
    return last.result;
  };
}

/** Return a function that returns the last result again while the new one is equal to it. */
export function stable<Input, Result>(
  compute: (input: Input) => Result,
  equal: (one: Result, other: Result) => boolean,
): (input: Input) => Result {
  let last: { result: Result } | undefined;
  return (input) => {
    const result = compute(input);
    if (!last || !equal(last.result, result)) last = { result };
    return last.result;
  };
}

/** Like `memoized`, for any number of objects: each result lives as long as its object. */
export function perObject<Input extends object, Result>(compute: (input: Input) => Result): (input: Input) => Result {
  const known = new WeakMap<Input, { result: Result }>();
  return (input) => {
    const found = known.get(input) ?? { result: compute(input) };
    known.set(input, found);
    return found.result;
  };
}
