/** Completion and signatures in the program text. */

import { expect, test } from "vitest";
import { meta, program, TYPES } from "../../program/testing";
import { identifier, offersAt, parameterWords, signatureAt } from "./offers";

const SCRIPT = `def main(res: Resources) -> None:
    aps = ActionPoints(res)

    # Objects of the scene
    robot: Device = res.objects["device"]

    # Project parameters
    so_many = 5

    while True:
        first = robot.count(1, an="first")
        try:
            robot.act(an="try")
        except DeviceFault as error:
            problem = res.caught(error)
            ERROR
        if robot.ask(an="sure"):
            inner = robot.count(2, an="inner")
        HERE
`;
const types = {
  ...TYPES,
  actions: {
    Device: [
      ...(TYPES.actions.Device ?? []),
      {
        ...meta(
          "move",
          [],
          [
            { name: "pose", type: "pose", dynamic_value: false },
            { name: "speed", type: "double", dynamic_value: false, default_value: "1" },
            { name: "safe", type: "boolean", dynamic_value: false },
          ],
        ),
        description: "Move to a pose.",
      },
    ],
  },
};
const base = program({}, []);
const doc = {
  ...base,
  orientations: {
    o: { id: "o", name: "above it", pointId: "point", orientation: { x: 0, y: 0, z: 0, w: 1 } },
  },
};
/** Return the offers after a text is typed at a mark. */
function typed(text: string, mark = "HERE") {
  const start = SCRIPT.indexOf(mark);
  const source = SCRIPT.replace(mark, text);
  return { source, at: start + text.length, found: offersAt(source, start + text.length, doc, types) };
}
const labels = (text: string, mark?: string) => typed(text, mark).found?.offers.map((each) => each.label) ?? [];

test("variables are offered where they are assigned", () => {
  expect(labels("x")).toEqual(["first", "so_many", "robot", "aps"]);
  expect(labels("x", "ERROR")).toContain("problem");
  expect(labels("problem.", "ERROR")).toEqual(["device", "kind", "text"]);
  expect(typed("fi").found?.from).toBe(SCRIPT.indexOf("HERE"));
});

test("actions of an object are inserted with their parameters and a free name", () => {
  const move = typed("robot.").found?.offers.find((each) => each.label === "move");
  expect(move).toMatchObject({ info: "Move to a pose.", detail: "(pose, speed, safe)" });
  // biome-ignore lint/suspicious/noTemplateCurlyInString: fields of a snippet
  expect(move?.snippet).toBe('move(${pose}, ${1.0}, ${safe}, an="${move}")');
  expect(typed("robot.").found?.offers.find((each) => each.label === "act")?.detail).toBe("()");
});

test("points, poses and joints are offered", () => {
  expect(labels("robot.move(aps.")).toEqual(["point"]);
  expect(labels("robot.move(aps.point.")).toEqual(["position", "poses", "joints"]);
  expect(labels("robot.move(aps.point.poses.")).toEqual(["above_it"]);
  expect(labels("robot.move(aps.nothing.")).toEqual([]);
});

test("values of the type of the parameter come first", () => {
  expect(labels("robot.move(")[0]).toBe("aps.point.poses.above_it");
  expect(labels("robot.move(x, 1.0, T").slice(0, 2)).toEqual(["True", "False"]);
  const fitting = (text: string) => typed(text).found?.offers.flatMap((each) => (each.fits ? [each.label] : []));
  expect(fitting("robot.count(f")).toEqual(["first", "so_many"]);
});

test("nothing is offered in strings, comments and numbers", () => {
  for (const text of ['robot.act(an="r', "# r", "robot.count(1", "from r"]) expect(labels(text)).toEqual([]);
});

test("the signature of a call knows the parameter at the cursor", () => {
  const active = (text: string) => {
    const { source, at } = typed(text);
    const found = signatureAt(source, at, doc, types);
    return found && [found.action.name, found.active];
  };
  expect(active("robot.move(")).toEqual(["move", 0]);
  expect(active('robot.move(f(1, "a,("), ')).toEqual(["move", 1]);
  expect(active("robot.move(\n            aps.point.poses.above_it,\n            ")).toEqual(["move", 1]);
  expect(active("robot.move(safe=")).toEqual(["move", 2]);
  expect(active("robot.move(x, an=")).toEqual(["move", -1]);
  expect(active("robot.move(x)")).toBeNull();
  expect(active("robot.nothing(")).toBeNull();
});

test("names are converted as in generated scripts", () => {
  expect(["pick up", "2nd", "class", "__x", "é"].map(identifier)).toEqual(["pick_up", "_2nd", "class_", "_x", "_"]);
  expect(parameterWords({ name: "speed", type: "double", dynamic_value: false, default_value: "1" })).toBe(
    "speed: number = 1.0",
  );
});

test("functions are completed and have a signature", () => {
  const called = {
    ...{ id: "pfu", name: "handle board", actions: {}, logic: {}, returns: [{ type: "boolean", link: "x/default/0" }] },
    parameters: [{ name: "code", type: "string", value: "" }],
  };
  const known = { ...doc, functions: { pfu: called } };
  const source = "def main(res: Resources) -> None:\n    while True:\n        fine = handle_board(";
  expect(signatureAt(source, source.length, known, types)?.action.parameters.map((each) => each.name)).toEqual([
    "code",
  ]);
  const offer = offersAt(source, source.length, known, types)?.offers.find((each) => each.label === "handle_board");
  // biome-ignore lint/suspicious/noTemplateCurlyInString: fields of a snippet
  expect(offer?.snippet).toBe('handle_board(${code}, an="${handle_board}")');
  const later = `${source}"A", an="handle")\n        `;
  const fine = offersAt(later, later.length, known, types)?.offers.find((each) => each.label === "fine");
  expect(fine?.detail).toBe("yes or no");
});
