/** The address of the page of inputs and outputs, which contains the page from which it was opened. */

const PAGE = "#/io";

/** Open the page: `#/operator` becomes `#/io/operator`. */
export function openPoints(): void {
  if (!location.hash.startsWith(PAGE)) location.hash = location.hash.replace(/^#?/, PAGE);
}

/** Return to the page from which it was opened. */
export function closePoints(): void {
  location.hash = location.hash.slice(PAGE.length);
}
