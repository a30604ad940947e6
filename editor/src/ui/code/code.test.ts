/** The code view: a script read from a package, split into pieces for highlighting. */

import { deflateRawSync } from "node:zlib";
import { expect, test } from "vitest";
import { textOfZip } from "./package";
import { pieces } from "./python";

test("a file is read from a zip archive, compressed or stored", async () => {
  const files: [string, string, boolean][] = [
    ["a.txt", "first", false],
    ["script.py", "print('hello')\n".repeat(50), true],
  ];
  const parts: Buffer[] = [];
  const directory: Buffer[] = [];
  let at = 0;
  for (const [name, text, packed] of files) {
    const content = packed ? deflateRawSync(Buffer.from(text)) : Buffer.from(text);
    const local = Buffer.alloc(30);
    local.writeUInt32LE(0x04034b50, 0);
    local.writeUInt16LE(packed ? 8 : 0, 8);
    local.writeUInt16LE(name.length, 26);
    const entry = Buffer.alloc(46);
    entry.writeUInt32LE(0x02014b50, 0);
    entry.writeUInt16LE(packed ? 8 : 0, 10);
    entry.writeUInt32LE(content.length, 20);
    entry.writeUInt16LE(name.length, 28);
    entry.writeUInt32LE(at, 42);
    directory.push(entry, Buffer.from(name));
    parts.push(local, Buffer.from(name), content);
    at += 30 + name.length + content.length;
  }
  const end = Buffer.alloc(22);
  end.writeUInt32LE(0x06054b50, 0);
  end.writeUInt16LE(files.length, 10);
  end.writeUInt32LE(at, 16);
  const zip = new Uint8Array(Buffer.concat([...parts, ...directory, end])).buffer;
  expect(await textOfZip(zip, "script.py")).toBe(files[1]?.[1]);
  expect(await textOfZip(zip, "a.txt")).toBe("first");
  expect(await textOfZip(zip, "none")).toBeUndefined();
  await expect(textOfZip(new ArrayBuffer(40), "a.txt")).rejects.toThrow("cannot be downloaded");
});

test("tokens contain every character, and strings can span lines", () => {
  const source = 'def f(x):  # why\n    """One\n    two."""\n    return x_1 + 2.5e-3';
  const lines = pieces(source);
  expect(lines.map((line) => line.map((each) => each.text).join("")).join("\n")).toBe(source);
  expect(lines[0]?.[0]).toEqual({ text: "def", kind: "word" });
  expect(lines[0]?.at(-1)).toEqual({ text: "# why", kind: "comment" });
  expect(lines[2]?.[0]?.kind).toBe("text");
  expect(lines[3]?.at(-1)).toEqual({ text: "2.5e-3", kind: "number" });
});
