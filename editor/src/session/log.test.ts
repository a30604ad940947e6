import { expect, it } from "vitest";
import { getState } from "../store/store";
import { note } from "./log";

it("the diary keeps the newest entries and limits their length", () => {
  for (let n = 0; n < 500; n++) note("event", `SceneChanged ${n}`);
  note("refused", "x".repeat(2000));
  const { diary } = getState().runtime;
  expect(diary).toHaveLength(400);
  expect(diary[0]?.text).toBe("SceneChanged 101");
  expect(diary.at(-1)?.text).toHaveLength(400);
});
