import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Lease, type LeaseRequest } from "./lease";

let sent: LeaseRequest[];
let answer: (request: LeaseRequest) => Promise<unknown>;
const send = (request: LeaseRequest) => {
  sent.push(request);
  return answer(request);
};

beforeEach(() => {
  vi.useFakeTimers();
  sent = [];
  answer = () => Promise.resolve({});
});
afterEach(() => vi.useRealTimers());

test("a lease is renewed ten times a second while it is held, and released at once", async () => {
  const lease = new Lease(1, send, () => 5);
  lease.begin();
  await vi.advanceTimersByTimeAsync(1000);
  expect(sent.length).toBe(11);
  expect(new Set(sent.map((each) => each.hold)).size).toBe(1);
  expect(sent.every((each) => each.valid_ms === 300 && each.sent_ms === 5)).toBe(true);
  lease.end();
  expect(sent.at(-1)?.valid_ms).toBe(0);
  await expect(lease.over).resolves.toBe("");
  await vi.advanceTimersByTimeAsync(1000);
  expect(sent.length).toBe(12);
});

test("a lease that was released before its start never starts", async () => {
  const lease = new Lease(1, send);
  lease.end();
  lease.begin();
  await expect(lease.over).resolves.toBe("");
  expect(sent).toEqual([]);
});

test("a refusal ends the lease with its reason, without further requests", async () => {
  answer = () => Promise.reject(new Error("robot: the joint elbow is at its limit."));
  const lease = new Lease(1, send);
  lease.begin();
  await expect(lease.over).resolves.toBe("robot: the joint elbow is at its limit.");
  await vi.advanceTimersByTimeAsync(1000);
  expect(sent.length).toBe(1);
  expect(lease.held).toBe(false);
});
