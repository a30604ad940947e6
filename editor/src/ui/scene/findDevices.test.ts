import { createElement } from "react";
import { renderToStaticMarkup } from "react-dom/server";
import { expect, test } from "vitest";
import type { FoundDevice } from "../../protocol/types";
import { Found } from "./FindDevices";

const shown = (found: FoundDevice[], value?: string) =>
  renderToStaticMarkup(createElement(Found, { found, value, onFound: () => {} }));

test("found devices are offered by what they are, with address and serial number; the chosen one is marked", () => {
  const adapter = { value: '"/dev/ttyUSB3"', address: "/dev/ttyUSB3", description: "Scale", serial: "A5" };
  const bare = { value: '"/dev/ttyS1"', address: "/dev/ttyS1", description: "", serial: "" };
  const markup = shown([adapter, bare], bare.value);
  expect(markup).toContain(">Scale</strong>");
  expect(markup).toContain("/dev/ttyUSB3 · serial number A5");
  expect(markup).toContain(">/dev/ttyS1</strong>");
  expect(markup.match(/aria-pressed="(true|false)"/g)).toEqual(['aria-pressed="false"', 'aria-pressed="true"']);
});

test("without a device it says what to check", () => {
  expect(shown([])).toContain("Nothing found. Check the cable and the power.");
});
