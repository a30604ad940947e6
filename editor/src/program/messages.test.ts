import { expect, it } from "vitest";
import type { TraceEntry } from "../protocol/types";
import type { State } from "../store/state";
import { shownMessage, splitAddress } from "./messages";

const entry = (number: number, action_id: string, ...parameters: string[]): TraceEntry => ({
  run: 1,
  number,
  name: action_id,
  action_id,
  started: "2026-01-01T00:00:00Z",
  parameters: parameters.map((each) => JSON.stringify(each)),
});

const stateOf = (...trace: TraceEntry[]) =>
  ({
    doc: {
      objects: { obj_flow: { type: "FlowActions" }, obj_other: { type: "Display" } },
      actions: {
        greet: { type: "obj_flow/show_message" },
        warn: { type: "obj_flow/show_message" },
        wait: { type: "obj_flow/wait" },
        other: { type: "obj_other/show_message" },
      },
      program: { actions: {}, logic: {} },
      functions: {},
    },
    program: { trace },
  }) as unknown as State;

it("shows the latest message of the run", () => {
  expect(shownMessage(stateOf())).toBe("");
  expect(shownMessage(stateOf(entry(1, "greet", 'Refill "A"')))).toBe('Refill "A"');
  const later = stateOf(
    entry(1, "greet", "one"),
    entry(2, "warn", "two"),
    entry(3, "wait", "1"),
    entry(4, "other", "x"),
  );
  expect(shownMessage(later)).toBe("two");
});

it("shows nothing before the document is known", () => {
  expect(shownMessage({ ...stateOf(entry(1, "greet", "one")), doc: null })).toBe("");
});

it("separates the addresses of a device from a message", () => {
  const lost = { text: "robot (UR5e): the connection was lost", address: "host 127.163.219.71" };
  expect(splitAddress(`${lost.text} [${lost.address}]`)).toEqual(lost);
  const refused = splitAddress("robot: No RTDE port at 127.120.197.184:30004.");
  expect(refused).toEqual({ text: "robot: No RTDE port.", address: "127.120.197.184:30004" });
  expect(splitAddress("Motory robotu r1 (10.0.0.5) byly vypnuty.").text).toBe("Motory robotu r1 byly vypnuty.");
  expect(splitAddress("Control of robot (UR controller 127.0.0.9:30004) failed.").text).toBe(
    "Control of robot failed.",
  );
  const unread = splitAddress("reader at /dev/pts/4: no code was read within 2 s");
  expect(unread).toEqual({ text: "reader: no code was read within 2 s", address: "/dev/pts/4" });
  const simulated = splitAddress("reader at /tmp/arcor2-fake-5omxc6d9/tty: no code was read within 2 s");
  expect(simulated).toEqual({ ...unread, address: "/tmp/arcor2-fake-5omxc6d9/tty" });
  for (const text of ["Ready.", "version 1.2.3 at 5.0 s", "use [a] or [b] here", "[host x]"])
    expect(splitAddress(text)).toEqual({ text, address: "" });
});
