import { afterEach, expect, it, vi } from "vitest";
import { rest } from "./rest";

afterEach(() => vi.unstubAllGlobals());

const silent = (_: string, { signal }: RequestInit) =>
  new Promise<Response>((_resolve, reject) => {
    signal?.addEventListener("abort", () => reject(signal.reason as Error));
  });

it("a request that is not answered fails with a sentence", async () => {
  vi.stubGlobal("fetch", silent);
  await expect(rest("/api/joining", { deadline: 0.01 })).rejects.toThrow("The server did not answer within 0.01 s.");
});

it("a refusal is translated, and other errors are unchanged", async () => {
  vi.stubGlobal("fetch", async () => Response.json({ message: "No." }, { status: 409 }));
  await expect(rest("/scenes")).rejects.toThrow("No.");
  vi.stubGlobal("fetch", async () => new Response("", { status: 502 }));
  await expect(rest("/scenes", { failure: "It failed" })).rejects.toThrow("It failed (502).");
  vi.stubGlobal("fetch", () => Promise.reject(new TypeError("Failed to fetch")));
  await expect(rest("/scenes")).rejects.toThrow(TypeError);
});
