/** The code view: a script read from a package, its actions and folded parts. */

import { deflateRawSync } from "node:zlib";
import { expect, test } from "vitest";
import { textOfZip } from "./package";
import { actionsOf, boilerplate, idsOf } from "./script";

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

const SCRIPT = `"""Main script of the project Sort."""

from action_points import ActionPoints
from arcor2_hw.runtime.resources import Resources
from object_types.arm import Arm


def main(res: Resources) -> None:
    aps = ActionPoints(res)

    # Objects of the scene
    robot: Arm = res.objects["obj_0123456789abcdef0123456789abcdef"]
    table: tableType = res.objects["obj_2"]

    # Project parameters
    boards = 2

    while True:
        robot.pick(aps.feeder.poses.default, an="pick")
        robot.move_joints(
            aps.feeder.joints.above,
            an="say \\"above\\"",
        )


if __name__ == "__main__":
    main(Resources())
`;

test("the actions of a script are found by their names, also in calls of several lines", () => {
  const line = (at: number) => SCRIPT.slice(0, at).split("\n").length;
  expect(actionsOf(SCRIPT).map(({ name, from, to }) => [name, line(from), line(to)])).toEqual([
    ["pick", 19, 19],
    ['say "above"', 20, 22],
  ]);
});

test("imports, objects and entry point are folded, and ids are found", () => {
  const folded = boilerplate(SCRIPT).map(({ from, to }) => SCRIPT.slice(from, to).trim().split("\n"));
  expect(folded.map((lines) => [lines[0]?.trim(), lines.at(-1)?.trim()])).toEqual([
    ["from arcor2_hw.runtime.resources import Resources", "from object_types.arm import Arm"],
    ['robot: Arm = res.objects["obj_0123456789abcdef0123456789abcdef"]', 'table: tableType = res.objects["obj_2"]'],
    ["main(Resources())", "main(Resources())"],
  ]);
  expect(boilerplate("print(1)\n")).toEqual([]);
  expect(idsOf(SCRIPT).map(({ id }) => id)).toEqual(["obj_0123456789abcdef0123456789abcdef"]);
});
