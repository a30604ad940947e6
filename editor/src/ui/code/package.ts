/** Read one file from a zip archive with browser functions. */

import { t } from "@lingui/core/macro";

const END_OF_DIRECTORY = 0x06054b50;
const ENTRY = 0x02014b50;

/** Return a text file of a zip archive; undefined if it is missing. Reject if the data is not a zip archive. */
export async function textOfZip(content: ArrayBuffer, name: string): Promise<string | undefined> {
  const view = new DataView(content);
  let end = content.byteLength - 22;
  while (end >= 0 && view.getUint32(end, true) !== END_OF_DIRECTORY) end--;
  if (end < 0) throw new Error(t`The package cannot be downloaded.`);
  let at = view.getUint32(end + 16, true);
  for (let left = view.getUint16(end + 10, true); left > 0 && view.getUint32(at, true) === ENTRY; left--) {
    const [nameSize, extra, comment] = [28, 30, 32].map((offset) => view.getUint16(at + offset, true)) as [
      number,
      number,
      number,
    ];
    if (new TextDecoder().decode(new Uint8Array(content, at + 46, nameSize)) === name) {
      const size = view.getUint32(at + 20, true);
      const local = view.getUint32(at + 42, true);
      const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
      const bytes = new Uint8Array(content, start, size);
      return view.getUint16(at + 10, true) === 0 ? new TextDecoder().decode(bytes) : inflated(bytes);
    }
    at += 46 + nameSize + extra + comment;
  }
  return undefined;
}

function inflated(bytes: Uint8Array<ArrayBuffer>): Promise<string> {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).text();
}
