import { describe, expect, it } from "vitest";
import { amountText, parseAmount, stepWords } from "./amounts";

const DEGREE = Math.PI / 180;

describe("an amount", () => {
  it.each([
    ["12.5", 0.0125],
    ["12,5", 0.0125],
    ["-3", -0.003],
    ["3cm", 0.03],
    ["0.2 m", 0.2],
    ["1in", 0.0254],
    ['2"', 0.0508],
    ["1in/2", 0.0127],
    ["10 + 2.5", 0.0125],
    ["1cm-2mm", 0.008],
    [".5*4", 0.002],
    ["−4", -0.004],
  ])("%s", (text, value) => expect(parseAmount(text, 0.1, "mm")).toBeCloseTo(value, 12));

  it.each([
    ["+12.5", 0.1125],
    ["+3cm", 0.13],
    ["+=1", 0.101],
    ["-=3mm", 0.097],
    ["+10-2", 0.108],
  ])("%s changes what is there", (text, value) => expect(parseAmount(text, 0.1, "mm")).toBeCloseTo(value, 12));

  it("is relative with a sign or by option", () => {
    expect(parseAmount("-3mm", 0.1, "m", true)).toBeCloseTo(0.097, 12);
    expect(parseAmount("5", 0.1, "cm", true)).toBeCloseTo(0.15, 12);
  });

  it("of an angle can have minutes and seconds", () => {
    expect(parseAmount("90", 0, "°")).toBeCloseTo(Math.PI / 2, 12);
    expect(parseAmount("90°", 0, "rad")).toBeCloseTo(Math.PI / 2, 12);
    expect(parseAmount("+1′", DEGREE, "°")).toBeCloseTo(DEGREE * (1 + 1 / 60), 12);
    expect(parseAmount('3"', 0, "°")).toBeCloseTo(DEGREE / 1200, 12);
    expect(parseAmount("1.5rad", 0, "°")).toBeCloseTo(1.5, 12);
  });

  it.each(["", " ", "abc", "1..2", "3kg", "5°", "1/0", "--2", "2+", "1e3"])("%j is invalid", (text) => {
    expect(parseAmount(text, 0, "mm")).toBeNull();
  });

  it("is shown without trailing zeros", () => {
    expect(amountText(0.0125, "mm")).toBe("12.5");
    expect(amountText(-0, "mm")).toBe("0");
    expect(amountText(-1e-9, "mm")).toBe("0");
    expect(amountText(0.1, "m")).toBe("0.1");
    expect(amountText(100, "mm")).toBe("100000");
    expect(amountText(Math.PI / 2, "°")).toBe("90");
    expect([stepWords(0.01, "length"), stepWords(0.0025, "length"), stepWords(DEGREE / 60, "angle")]).toEqual([
      "1 cm",
      "2.5 mm",
      "1′",
    ]);
  });
});
