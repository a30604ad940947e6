import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { notify } from "../store/store";
import { awaited } from "./ownEvents";

beforeEach(() => vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

const noticeOf = (text: string) => awaited((state) => state.notices.find((each) => each.text === text)?.text);

test("resolves with what is already in the store, or as soon as it is", async () => {
  notify("info", "known");
  await expect(noticeOf("known")).resolves.toBe("known");
  const later = noticeOf("later");
  notify("info", "later");
  await expect(later).resolves.toBe("later");
});

test("rejects if nothing arrives in time", async () => {
  const missing = expect(noticeOf("missing")).rejects.toThrow("did not confirm");
  await vi.advanceTimersByTimeAsync(5000);
  await missing;
});
