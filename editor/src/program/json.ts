/** JSON values. */

/** Return the decoded value; undefined if it is not JSON. */
export function decoded(json: string | undefined): unknown {
  if (json === undefined) return undefined;
  try {
    return JSON.parse(json);
  } catch {
    return undefined;
  }
}
