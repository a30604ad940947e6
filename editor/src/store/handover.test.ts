import { expect, test } from "vitest";
import { handOver, hasAsked } from "./handover";
import { initialState, type State } from "./state";

const AT = 1_000_000;
function as(user: string, shared: Record<string, unknown>, locks: Record<string, string>): State {
  const state = initialState();
  return { ...state, connection: { ...state.connection, user }, view: { ...state.view, shared }, locks };
}
const wish = (by: string) => ({ "asked/arm": { by, at: AT } });

test("who holds it hears once who asks for it, and of nothing old, nor of what others hold", () => {
  const before = as("Eva", {}, { arm: "Eva" });
  const asked = as("Eva", wish("Adam"), { arm: "Eva" });
  expect(handOver(asked, before, AT).wanted).toEqual([{ id: "arm", by: "Adam" }]);
  expect(handOver({ ...asked, locks: { arm: "Eva", box: "Eva" } }, asked, AT).wanted).toEqual([]);
  expect(handOver(asked, before, AT + 3_600_000).wanted).toEqual([]);
  expect(handOver(as("Eva", wish("Adam"), { arm: "Berta" }), before, AT).wanted).toEqual([]);
  expect(handOver(as("Eva", { "asked/arm": "Adam" }, { arm: "Eva" }), before, AT)).toEqual({ wanted: [], free: [] });
});

test("who has asked hears when it is free", () => {
  const waiting = as("Adam", wish("Adam"), { arm: "Eva" });
  expect(hasAsked(waiting, "arm")).toBe(true);
  expect(hasAsked(as("Eva", wish("Adam"), {}), "arm")).toBe(false);
  expect(handOver({ ...waiting, locks: { box: "Eva" } }, waiting, AT)).toEqual({ wanted: [], free: ["arm"] });
  expect(handOver({ ...waiting, locks: { arm: "Berta" } }, waiting, AT).free).toEqual([]);
});
