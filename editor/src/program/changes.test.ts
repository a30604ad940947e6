import { expect, test } from "vitest";
import { Changes } from "./changes";

test("a change before the answer to the previous one builds on it, a later change on the stored value", async () => {
  const changes = new Changes<string>();
  const sent: string[] = [];
  const answers: (() => void)[] = [];
  const add = (stored: string, letter: string) =>
    changes.apply(
      stored,
      (value) => value + letter,
      (value) => {
        sent.push(value);
        return new Promise<void>((answer) => answers.push(answer));
      },
    );
  const first = add("", "a");
  const second = add("", "b");
  expect(sent).toEqual(["a", "ab"]);
  for (const answer of answers) answer();
  await Promise.all([first, second]);
  void add("other", "c");
  expect(sent[2]).toBe("otherc");
});

test("a refused change is forgotten", async () => {
  const changes = new Changes<string>();
  const refuse = () => Promise.reject(new Error("refused"));
  await expect(changes.apply("", () => "wrong", refuse)).rejects.toThrow("refused");
  expect(
    await changes.apply(
      "stored",
      (value) => `${value}!`,
      async (value) => value,
    ),
  ).toBe("stored!");
});
