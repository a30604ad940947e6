import { expect, test } from "vitest";
import { parsed } from "./fields";

test("typed numbers and relative changes are parsed", () => {
  expect(parsed("12.5", 3)).toBe(12.5);
  expect(parsed(" 12,5 ", 3)).toBe(12.5);
  expect(parsed("-4", 3)).toBe(-4);
  expect(parsed("+4", 3)).toBe(7);
  expect(parsed("-=4", 3)).toBe(-1);
  for (const wrong of ["", "four", "1.2.3", "+", "1e999"]) expect(parsed(wrong, 3)).toBeNull();
});
