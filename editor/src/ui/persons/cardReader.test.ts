import { expect, test } from "vitest";
import { CardKeys, MAX_GAP } from "./cardReader";

/** Type keys with a time between them, ms; return the card and what reached the page, with Enter as a line break. */
function typed(text: string, gap: number): { cards: string[]; page: string } {
  const keys = new CardKeys();
  const cards: string[] = [];
  let page = "";
  let at = 1000;
  for (const each of text) {
    at += gap;
    if (gap > MAX_GAP) page += keys.flush(); // the timer of the page has ended
    const verdict = keys.key(each === "\n" ? "Enter" : each, at);
    if ("card" in verdict) cards.push(verdict.card);
    else if (!verdict.hold) page += verdict.typed + each;
  }
  return { cards, page: page + keys.flush() };
}

test("fast keys that end with Enter are a card and reach no field", () => {
  expect(typed("0012345678\n", 8)).toEqual({ cards: ["0012345678"], page: "" });
  expect(typed("AB-77\n0012345678\n", 20)).toEqual({ cards: ["AB-77", "0012345678"], page: "" });
});

test("keys of a person reach the field in their order", () => {
  expect(typed("Eva 2580\n", 120)).toEqual({ cards: [], page: "Eva 2580\n" });
});

test("does not take a few fast keys for a card", () => {
  expect(typed("258\n", 10)).toEqual({ cards: [], page: "258\n" });
  expect(typed("Eva 2580", 10)).toEqual({ cards: [], page: "Eva 2580" });
});

test("a busy page that gives the first keys away still reads the whole card", () => {
  const keys = new CardKeys();
  keys.key("1", 1000);
  expect(keys.flush()).toBe("1"); // the timer came before the next key
  for (const [index, each] of [..."2345"].entries()) expect(keys.key(each, 1010 + index)).toEqual({ hold: true });
  expect(keys.key("Enter", 1020)).toEqual({ card: "12345", late: 1 });
  expect(keys.key("Enter", 1030)).toEqual({ hold: false, typed: "" });
});
