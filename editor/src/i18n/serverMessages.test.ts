import { afterEach, expect, test } from "vitest";
import { Refused } from "../protocol/errors";
import { inUserLanguage, translate, translatedAlarm } from "./serverMessages";
import { setTranslations } from "./testing";

afterEach(() => setTranslations({}));

test("a message is translated by its template, with its values", () => {
  setTranslations({ "The name {name} is in use.": "Jméno {name} je obsazené." });
  const message = { text: "The name 'a' is in use.", key: "The name {name} is in use.", values: { name: "'a'" } };
  expect(translate(message)).toBe("Jméno 'a' je obsazené.");
  expect(new Refused("NewScene", [message.text], "conflict", message).message).toBe("Jméno 'a' je obsazené.");
});

test("a message without values is translated by its text", () => {
  setTranslations({ "No {x}.": "Ne {x}." });
  expect(translate({ text: "No {x}." })).toBe("Ne {x}.");
});

test("a message within a message is translated too", () => {
  setTranslations({ "{device} is busy.": "{device} má práci." });
  const problem = { text: "Scale is busy.", key: "{device} is busy.", values: { device: "Scale" } };
  const message = { text: "s1: Scale is busy.", key: "{device}: {problem}", values: { device: "s1", problem } };
  expect(translate(message)).toBe("s1: Scale má práci.");
});

test("decimal numbers in a message are written as usual in the language, other values are unchanged", () => {
  setTranslations({ "{distance} of {robot}, {version}": "{distance} k {robot}, {version}" }, "cs");
  const values = { distance: "-12.50 mm", robot: "arm1.5b", version: "5.11" };
  const message = { text: "", key: "{distance} of {robot}, {version}", values };
  expect(translate(message)).toBe("-12,50 mm k arm1.5b, 5.11");
  expect(translate({ ...message, values: { ...values, distance: "0.5" } })).toBe("0,5 k arm1.5b, 5.11");
  expect(translate({ ...message, values: { ...values, distance: "10.0.0.2" } })).toBe("10.0.0.2 k arm1.5b, 5.11");
});

test("text and remedy of an alarm are translated, with their values", () => {
  setTranslations({ "servo {number}": "servo č. {number}", "Let it cool": "Nechte vychladnout" });
  const text_message = { text: "servo 1", key: "servo {number}", values: { number: "1" } };
  const alarm = { code: "1", text: "servo 1", remedy: "Let it cool", text_message };
  expect(translatedAlarm(alarm)).toMatchObject({ code: "1", text: "servo č. 1", remedy: "Nechte vychladnout" });
});

test("without a translation the English text is shown", () => {
  expect(translate({ text: "No a.", key: "No {name}.", values: { name: "a" } })).toBe("No a.");
  expect(translate({ text: "{a}", key: "{{{name}}}", values: { name: "a" } })).toBe("{a}");
  expect(new Refused("NewScene", ["No."]).message).toBe("No.");
});

test("the message of an event is translated in every known field", () => {
  setTranslations({ "It was stopped.": "Zastaveno." });
  expect(inUserLanguage({ state: "stopped", message: "It was stopped." })).toEqual({
    state: "stopped",
    message: "Zastaveno.",
  });
  expect(inUserLanguage({ object_id: "a", reason: "It was stopped." }).reason).toBe("Zastaveno.");
  setTranslations({ "Building {name}": "Sestavuje se {name}" });
  const title_message = { text: "Building a", key: "Building {name}", values: { name: "a" } };
  expect(inUserLanguage({ title: "Building a", title_message }).title).toBe("Sestavuje se a");
  const data = { joints: [1, 2] };
  expect(inUserLanguage(data)).toBe(data);
  expect(inUserLanguage(undefined)).toBe(undefined);
});
