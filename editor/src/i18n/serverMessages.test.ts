import { i18n } from "@lingui/core";
import { afterEach, expect, test } from "vitest";
import { Refused } from "../protocol/errors";
import { PREFIX, translate } from "./serverMessages";

afterEach(() => i18n.loadAndActivate({ locale: "en", messages: {} }));

test("a message with a known key is translated with its values", () => {
  i18n.loadAndActivate({ locale: "cs", messages: { [`${PREFIX}name_taken`]: ["Jméno ", ["name"], " je obsazené."] } });
  const message = { text: "The name 'a' is in use.", key: "name_taken", values: { name: "a" } };
  expect(translate(message)).toBe("Jméno a je obsazené.");
  expect(new Refused("NewScene", ["The name 'a' is in use."], "conflict", message).message).toBe(
    "Jméno a je obsazené.",
  );
});

test("the English text is shown for an unknown key, and by servers that send none", () => {
  expect(translate({ text: "No.", key: "unknown", values: {} })).toBe("No.");
  expect(translate({ text: "No." })).toBe("No.");
  expect(new Refused("NewScene", ["No."]).message).toBe("No.");
});
