/** The fields that differ between two versions of an item. */

interface Difference {
  /** Names of the fields from the outside in, with dots: `position.x`. */
  field: string;
  before: string;
  after: string;
}

/** Return the differing fields, with their values as text. A missing field or item is empty. */
export function differences(before: unknown, after: unknown, field = ""): Difference[] {
  if (isObject(before) || isObject(after)) {
    const [old, fresh] = [fieldsOf(before), fieldsOf(after)];
    const names = new Set([...Object.keys(old), ...Object.keys(fresh)]);
    return [...names].flatMap((name) => differences(old[name], fresh[name], field ? `${field}.${name}` : name));
  }
  const [old, fresh] = [asText(before), asText(after)];
  return old === fresh ? [] : [{ field, before: old, after: fresh }];
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null;
}

function fieldsOf(value: unknown): Record<string, unknown> {
  return isObject(value) ? value : {};
}

function asText(value: unknown): string {
  if (value === undefined || value === null) return "";
  return typeof value === "string" ? value : JSON.stringify(value);
}
