import { expect, it } from "vitest";
import { diary, note } from "./log";

it("keeps the newest, each up to a length", () => {
  for (let n = 0; n < 500; n++) note("event", `SceneChanged ${n}`);
  note("refused", "x".repeat(2000));
  expect(diary()).toHaveLength(400);
  expect(diary()[0]?.text).toBe("SceneChanged 101");
  expect(diary().at(-1)?.text).toHaveLength(400);
});
