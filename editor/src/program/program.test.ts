/** What is asked of a program without a server: ways that are free, results that can be used, faults, values. */

import { deflateRawSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { against } from "../commands/aimed";
import type { LogicItem, ObjectAction, Project, Reach, Scene } from "../protocol/types";
import { opened } from "../store/document";
import type { OpenDocument, State } from "../store/state";
import { initialState } from "../store/state";
import { textOfZip } from "../ui/code/package";
import { pieces } from "../ui/code/python";
import { firstIn, graphOf, lastIn } from "../ui/flow/graph";
import { cannotLead, conditionWords, freeStep, usable } from "./logic";
import { freeName, newOutputs } from "./naming";
import { problemsOf, usersOf } from "./problems";
import { reachOfAction } from "./reach";
import { foldedRuns, runsOf } from "./runs";
import { double, extraOf, initial, rangeWords, read, textOf } from "./values";

const meta = (name: string, returns: string[], parameters: ObjectAction["parameters"] = []): ObjectAction => ({
  name,
  parameters,
  returns,
  disabled: false,
  meta: { composite: false, hidden: false, cancellable: false },
});
const number = { name: "by", type: "integer", dynamic_value: false };
const TYPES: State["types"] = {
  ...initialState().types,
  actions: { Device: [meta("ask", ["boolean"]), meta("count", ["integer"], [number]), meta("act", [])] },
};

/** Actions a, b, ... by their kinds, on one point; steps as [from, to, value of from's result]. */
function program(
  kinds: Record<string, string>,
  steps: [string, string, string?][] = [],
  parameters: Record<string, object> = {},
): OpenDocument {
  const at = { x: 0, y: 0, z: 0 };
  const actions = Object.entries(kinds).map(([id, kind]) => {
    const outputs = kind === "act" ? [] : [`${id}_result`];
    const given = kind === "count" ? [{ name: "by", type: "integer", value: "1", ...parameters[id] }] : [];
    return { id, name: id, type: `device/${kind}`, parameters: given, flows: [{ type: "default" as const, outputs }] };
  });
  const logic = steps.map(
    ([start, end, value], index): LogicItem => ({
      id: `s${index}`,
      start,
      end,
      ...(value === undefined ? {} : { condition: { what: `${start}/default/0`, value } }),
    }),
  );
  const scene: Scene = {
    id: "scene",
    name: "scene",
    description: "",
    objects: [{ id: "device", name: "device", type: "Device", parameters: [] }],
  };
  const project: Project = {
    id: "project",
    name: "project",
    scene_id: "scene",
    description: "",
    has_logic: true,
    action_points: [{ id: "point", name: "point", position: at, orientations: [], robot_joints: [], actions }],
    parameters: [{ id: "par", name: "so_many", type: "integer", value: "5" }],
    functions: [],
    logic,
    object_overrides: [],
  };
  return opened(scene, project);
}

describe("steps", () => {
  test("the first way on asks for nothing, the second makes a branch of both", () => {
    const doc = program({ a: "ask", b: "act", c: "act" }, [
      ["START", "a"],
      ["a", "b"],
    ]);
    expect(freeStep(doc, TYPES, "b")).toEqual({});
    const what = "a/default/0";
    expect(freeStep(doc, TYPES, "a")).toEqual({
      condition: { what, value: "false" },
      first: { item: doc.logic.s1, condition: { what, value: "true" } },
    });
    const both = program({ a: "ask", b: "act", c: "act" }, [
      ["a", "b", "true"],
      ["a", "c", "false"],
    ]);
    expect(freeStep(both, TYPES, "a")).toBe("a has no free branch.");
    expect(freeStep(doc, TYPES, "START")).toMatch("one first action");
  });

  test("numbers that are not asked for yet are offered, and the way without a condition stays the rest", () => {
    const doc = program({ a: "count", b: "act", c: "act", d: "act" }, [
      ["a", "b"],
      ["a", "c", "0"],
    ]);
    expect(freeStep(doc, TYPES, "a")).toEqual({ condition: { what: "a/default/0", value: "1" } });
    expect(conditionWords(doc, TYPES, doc.logic.s0 as LogicItem)).toBe("else");
    expect(conditionWords(doc, TYPES, doc.logic.s1 as LogicItem)).toBe("a_result = 0");
    const plain = program({ a: "act", b: "act", c: "act" }, [["a", "b"]]);
    expect(freeStep(plain, TYPES, "a")).toMatch("no result to branch on");
  });

  test("what would be refused is told before", () => {
    const doc = program({ a: "act", b: "act", c: "act" }, [
      ["a", "b"],
      ["b", "c"],
    ]);
    expect(cannotLead(doc, "c", "a")).toBe("This connection would create a loop.");
    expect(cannotLead(doc, "a", "b")).toBe("These steps are already connected.");
    expect(cannotLead(doc, "a", "b", "s0")).toBe("");
    expect(cannotLead(doc, "START", "END")).not.toBe("");
    expect(cannotLead(doc, "a", "START")).not.toBe("");
    expect(cannotLead(doc, "a", "c")).toBe("");
  });

  test("only results that can be there are offered", () => {
    const doc = program({ a: "count", b: "count", c: "count", d: "count" }, [
      ["a", "b"],
      ["b", "c"],
    ]);
    expect(usable(doc, TYPES, "b", "integer").map((each) => each.name)).toEqual(["a_result"]);
    expect(usable(doc, TYPES, "c", "integer").map((each) => each.name)).toEqual(["a_result", "b_result"]);
    expect(usable(doc, TYPES, "c", "boolean")).toEqual([]);
    // One that is connected to nothing may come to stand anywhere.
    expect(usable(doc, TYPES, "d", "integer")).toHaveLength(3);
  });
});

describe("faults", () => {
  const texts = (doc: OpenDocument) => problemsOf(doc, TYPES).map((each) => `${each.level} ${each.id}: ${each.text}`);

  test("a sound program has none", () => {
    expect(
      texts(
        program({ a: "ask", b: "act" }, [
          ["START", "a"],
          ["a", "b", "true"],
          ["a", "END", "false"],
          ["b", "END"],
        ]),
      ),
    ).toEqual([]);
    expect(
      texts(
        program(
          { a: "count" },
          [
            ["START", "a"],
            ["a", "END"],
          ],
          { a: { type: "project_parameter", value: '"par"' } },
        ),
      ),
    ).toEqual([]);
  });

  test("dead ends, halves of branches and what is never run are named where they are", () => {
    expect(texts(program({ a: "act" }))).toEqual([
      "error START: Start has no next step. Connect it to the first action.",
      "warn a: a is never run: no step leads to it.",
    ]);
    expect(texts(program({ a: "act" }, [["START", "a"]]))).toContain(
      "error a: a has no next step. Connect it to an action or to End.",
    );
    expect(
      texts(
        program({ a: "ask" }, [
          ["START", "a"],
          ["a", "END", "true"],
        ]),
      ),
    ).toEqual(["error a: a: no next step if a_result is no."]);
    expect(
      texts(
        program({ a: "count" }, [
          ["START", "a"],
          ["a", "END", "3"],
        ]),
      ),
    ).toEqual(["error a: a: no next step if none of the conditions is met."]);
  });

  test("values that are gone, and results of what comes later", () => {
    const gone = program(
      { a: "count" },
      [
        ["START", "a"],
        ["a", "END"],
      ],
      { a: { type: "project_parameter", value: '"away"' } },
    );
    expect(texts(gone)).toEqual(["error a: a: the variable used for by no longer exists."]);
    const later = program(
      { a: "count", b: "count" },
      [
        ["START", "a"],
        ["a", "b"],
        ["b", "END"],
      ],
      { a: { type: "link", value: '"b/default/0"' } },
    );
    expect(texts(later)).toEqual(["warn a: a: by uses a result of b, which does not run before it."]);
    expect(usersOf(later, TYPES, { action: "b" })).toEqual(["a"]);
    expect(usersOf(gone, TYPES, { parameter: "away" })).toEqual(["a"]);
  });
});

test("the graph goes from top to bottom, and offers the ways that are free", () => {
  const doc = program({ a: "ask", b: "act", c: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["b", "END"],
  ]);
  const { boxes, lines } = graphOf(doc, TYPES);
  const of = (id: string) => boxes.find((each) => each.id === id);
  const heights = ["START", "a", "b", "END"].map((id) => of(id)?.y ?? 0);
  expect(heights).toEqual([...heights].sort((one, other) => one - other));
  expect(new Set(heights).size).toBe(4);
  expect(of("a")?.ways.map((each) => each.id)).toEqual(["false"]);
  expect(of("START")?.ways).toEqual([]);
  expect(of("c")?.ways.map((each) => each.id)).toEqual(["next"]);
  expect(lines.map((each) => [each.words, each.branch])).toEqual([
    ["", "always"],
    ["yes", "true"],
    ["", "always"],
  ]);
});

describe("straight runs", () => {
  const doc = program({ a: "ask", b: "act", c: "act", d: "act", e: "act", f: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["b", "c"],
    ["c", "d"],
    ["d", "e"],
    ["a", "f", "false"],
    ["f", "e"],
    ["e", "END"],
  ]);

  test("end where ways part or meet, and are of three actions at least", () => {
    expect(runsOf(doc)).toEqual([["b", "c", "d"]]);
    // A condition, or a second way in, ends one.
    expect(
      runsOf(
        program({ a: "act", b: "ask", c: "act", d: "act" }, [
          ["a", "b"],
          ["b", "c", "true"],
          ["c", "d"],
        ]),
      ),
    ).toEqual([]);
    expect(runsOf(program({ a: "act", b: "act" }, [["a", "b"]]))).toEqual([]);
  });

  test("are one node with a count, which steps lead to and from as to and from its ends", () => {
    const folded = foldedRuns(doc, new Set(["c"]), new Set());
    const { boxes, lines } = graphOf(doc, TYPES, folded);
    const one = boxes.find((each) => each.kind === "fold");
    expect([one?.name, one?.detail]).toEqual(["3 actions", "b, c, d"]);
    expect(boxes.map((each) => each.id)).toEqual(["START", "a", "e", "f", "fold/b", "END"]);
    expect(lines.map((each) => [each.from, each.to])).toEqual([
      ["START", "a"],
      ["a", "fold/b"],
      ["fold/b", "e"],
      ["a", "f"],
      ["f", "e"],
      ["e", "END"],
    ]);
    expect(one && [firstIn(one), lastIn(one)]).toEqual(["b", "d"]);
  });

  test("are open where something in them is to be seen", () => {
    expect(foldedRuns(doc, new Set(["b", "c", "d"]), new Set(["d"]))).toEqual([]);
    expect(foldedRuns(doc, new Set(), new Set())).toEqual([]);
  });
});

describe("values", () => {
  test("a double keeps its fraction, limits hold, and what is no number is said", () => {
    expect(read("double", "1")).toEqual({ json: "1.0" });
    expect(read("double", "0,5")).toEqual({ json: "0.5" });
    expect(double(1e21)).toBe("1e+21");
    expect(read("integer", "1.5")).toEqual({ problem: "Enter a whole number." });
    expect(read("integer", "9", { maximum: 8 })).toEqual({ problem: "At most 8." });
    expect(read("integer", "")).toEqual({ problem: "Enter a number." });
    expect(read("string", ' "x" ')).toEqual({ json: JSON.stringify(' "x" ') });
    expect(textOf("string", JSON.stringify(' "x" '))).toBe(' "x" ');
    expect(rangeWords(extraOf({ extra: '{"minimum":0,"maximum":2,"unit":"m/s"}' }))).toBe("0 to 2 m/s");
    expect(extraOf({ extra: "no json" })).toEqual({});
  });

  test("what nobody has said is the least that is allowed", () => {
    const of = (type: string, extra?: object) =>
      initial({ name: "x", type, dynamic_value: false, ...(extra ? { extra: JSON.stringify(extra) } : {}) });
    expect([of("integer", { minimum: 3 }), of("double", { maximum: -2 }), of("boolean"), of("string")]).toEqual([
      "3",
      "-2.0",
      "false",
      '""',
    ]);
    expect(of("string_enum", { allowed_values: ["firm", "soft"] })).toBe('"firm"');
    expect(of("pose")).toBeUndefined();
  });

  test("names that are free", () => {
    expect(freeName("move", ["move", "move_2"])).toBe("move_3");
    expect(newOutputs(program({ ask: "ask" }), "ask", 2)).toEqual(["ask_result_1", "ask_result_2"]);
    expect(newOutputs(program({ ask: "ask" }), "ask", 1)).toEqual(["ask_result_2"]);
  });
});

test("a tool that stands on a surface looks against its normal", () => {
  for (const normal of [
    { x: 0, y: 0, z: 1 },
    { x: 1, y: 0, z: 0 },
    { x: 0, y: -0.6, z: 0.8 },
    { x: 0, y: 0, z: -1 },
  ]) {
    const { x, y, z, w } = against(normal);
    // The third column of the rotation's matrix.
    const axis = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)];
    [normal.x, normal.y, normal.z].forEach((each, index) => expect(axis[index]).toBeCloseTo(-each, 9));
  }
});

test("a file is read out of a zip, packed or not", async () => {
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

test("Python in pieces keeps every character, and texts over lines stay texts", () => {
  const source = 'def f(x):  # why\n    """One\n    two."""\n    return x_1 + 2.5e-3';
  const lines = pieces(source);
  expect(lines.map((line) => line.map((each) => each.text).join("")).join("\n")).toBe(source);
  expect(lines[0]?.[0]).toEqual({ text: "def", kind: "word" });
  expect(lines[0]?.at(-1)).toEqual({ text: "# why", kind: "comment" });
  expect(lines[2]?.[0]?.kind).toBe("text");
  expect(lines[3]?.at(-1)).toEqual({ text: "2.5e-3", kind: "number" });
});

describe("whether a robot gets there", () => {
  const action = (...parameters: [string, string][]) => ({
    type: "ur/move",
    parameters: parameters.map(([type, id], n) => ({ name: `p${n}`, type, value: JSON.stringify(id) })),
  });
  const told = (robot_id: string, end_effector_id: string, ...items: [string, Reach, string?][]) => ({
    [`${robot_id}//${end_effector_id}`]: {
      robot_id,
      end_effector_id,
      revision: 1,
      items: items.map(([id, reach, reason]) => ({ id, reach, ...(reason ? { reason } : {}) })),
    },
  });

  test("of each goal the end effector counts that gets there best, of all goals the worst", () => {
    const reach = {
      ...told("ur", "grip", ["a", "out_of_reach", "too far"], ["b", "in_collision", "table"]),
      ...told("ur", "cup", ["a", "reachable"], ["b", "out_of_reach", "too far"]),
    };
    expect(reachOfAction(action(["pose", "a"]), reach)?.reach).toBe("reachable");
    expect(reachOfAction(action(["pose", "a"], ["joints", "b"]), reach)).toEqual({
      reach: "in_collision",
      reason: "table",
      goal: "b",
    });
  });

  test("another robot does not count, nor what is no goal or not known", () => {
    const reach = told("other", "grip", ["a", "out_of_reach"]);
    expect(reachOfAction(action(["pose", "a"]), reach)).toBeNull();
    expect(reachOfAction(action(["position", "a"]), told("ur", "grip", ["a", "reachable"]))).toBeNull();
    expect(reachOfAction(action(["pose", "z"]), told("ur", "grip", ["a", "reachable"]))).toBeNull();
  });
});
