import { afterEach, expect, test } from "vitest";
import { Refused } from "../protocol/errors";
import { inUserLanguage, setTranslations, translate } from "./serverMessages";

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

test("a message inside another one is translated too", () => {
  setTranslations({ "{device} is busy.": "{device} má práci." });
  const problem = { text: "Scale is busy.", key: "{device} is busy.", values: { device: "Scale" } };
  const message = { text: "s1: Scale is busy.", key: "{device}: {problem}", values: { device: "s1", problem } };
  expect(translate(message)).toBe("s1: Scale má práci.");
});

test("without a translation the English text is shown", () => {
  expect(translate({ text: "No a.", key: "No {name}.", values: { name: "a" } })).toBe("No a.");
  expect(translate({ text: "{a}", key: "{{{name}}}", values: { name: "a" } })).toBe("{a}");
  expect(new Refused("NewScene", ["No."]).message).toBe("No.");
});

test("the message of an event is translated, whatever its field is called", () => {
  setTranslations({ "It was stopped.": "Zastaveno." });
  expect(inUserLanguage({ state: "stopped", message: "It was stopped." })).toEqual({
    state: "stopped",
    message: "Zastaveno.",
  });
  expect(inUserLanguage({ object_id: "a", reason: "It was stopped." }).reason).toBe("Zastaveno.");
  const data = { joints: [1, 2] };
  expect(inUserLanguage(data)).toBe(data);
  expect(inUserLanguage(undefined)).toBe(undefined);
});
