import { expect, test } from "vitest";
import type { ObjectTypeMeta, ParameterMeta } from "../protocol/types";
import type { OpenDocument } from "../store/state";
import { grouped, missing, missingForControl, uncontrolled } from "./settings";

const setting = (name: string, default_value?: string, for_control?: boolean): ParameterMeta => ({
  name,
  type: "double",
  dynamic_value: false,
  ...(default_value === undefined ? {} : { default_value }),
  ...(for_control ? { for_control } : {}),
});
const SETTINGS = [setting("host"), setting("payload_mass", "-1.0", true), setting("payload_cog_x", "0.0")];

test("settings without a default are required, and settings for control differ from their default", () => {
  expect(missing(SETTINGS, {})).toEqual(["host"]);
  expect(missing(SETTINGS, { host: '""' })).toEqual(["host"]);
  expect(missing(SETTINGS, { host: '"10.0.0.2"' })).toEqual([]);
  expect(missingForControl(SETTINGS, {})).toEqual(["payload_mass"]);
  expect(missingForControl(SETTINGS, { payload_mass: "-1.0" })).toEqual(["payload_mass"]);
  expect(missingForControl(SETTINGS, { payload_mass: "1.2" })).toEqual([]);
});

test("a device with missing settings cannot be controlled unless the project or the server sets them", () => {
  const arm = { id: "o1", name: "arm", type: "Arm", parameters: [{ name: "host", type: "string", value: '"a"' }] };
  const doc = { objects: { o1: arm }, overrides: {} } as unknown as OpenDocument;
  const types = { Arm: { settings: SETTINGS } as unknown as ObjectTypeMeta };
  expect(uncontrolled(doc, types, {})).toEqual([{ id: "o1", name: "arm", settings: ["payload_mass"] }]);
  const overlaid = { o1: { object_id: "o1", state: "online" as const, overlaid: ["payload_mass"] } };
  expect(uncontrolled(doc, types, overlaid)).toEqual([]);
  const value = { name: "payload_mass", type: "double", value: "1.0" };
  expect(uncontrolled({ ...doc, overrides: { o1: { payload_mass: value } } }, types, {})).toEqual([]);
  expect(uncontrolled(null, types, {})).toEqual([]);
});

test("settings with a common first word are grouped", () => {
  const found = grouped(["tcp_x", "speed", "tcp_y", "tcp_z", "part_x"].map((each) => setting(each, "0.0")));
  expect(found.map(({ title, settings }) => [title, settings.map(({ name }) => name)])).toEqual([
    ["tcp", ["tcp_x", "tcp_y", "tcp_z"]],
    ["", ["speed", "part_x"]],
  ]);
});
