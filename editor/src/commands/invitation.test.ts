import { expect, test } from "vitest";
import { isLocalHost } from "./invitation";

test.each(["localhost", "cell.localhost", "127.0.0.1", "127.83.1.7", "[::1]", "0.0.0.0"])(
  "%s is not an address for other devices",
  (host) => {
    expect(isLocalHost(host)).toBe(true);
  },
);

test.each([
  "127.example.com",
  "127.0.0.1.example.com",
  "localhost.example.com",
  "192.0.2.7",
  "cell-3",
  "[2001:db8::1]",
])("%s can be an address for other devices", (host) => {
  expect(isLocalHost(host)).toBe(false);
});
