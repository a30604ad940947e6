import { expect, test } from "vitest";
import { handOver, hasRequested } from "./handover";
import { initialState, type State } from "./state";

const AT = 1_000_000;
function as(user: string, shared: Record<string, unknown>, locks: Record<string, string>): State {
  const state = initialState();
  return { ...state, connection: { ...state.connection, user }, view: { ...state.view, shared }, locks };
}
const itemRequest = (by: string) => ({ "asked/arm": { by, at: AT } });

test("the holder is notified once of a request, but not of old ones or of items that others hold", () => {
  const before = as("Eva", {}, { arm: "Eva" });
  const asked = as("Eva", itemRequest("Adam"), { arm: "Eva" });
  expect(handOver(asked, before, AT).wanted).toEqual([{ id: "arm", by: "Adam" }]);
  expect(handOver({ ...asked, locks: { arm: "Eva", box: "Eva" } }, asked, AT).wanted).toEqual([]);
  expect(handOver(asked, before, AT + 3_600_000).wanted).toEqual([]);
  expect(handOver(as("Eva", itemRequest("Adam"), { arm: "Berta" }), before, AT).wanted).toEqual([]);
  expect(handOver(as("Eva", { "asked/arm": "Adam" }, { arm: "Eva" }), before, AT)).toEqual({ wanted: [], free: [] });
});

test("the requesting user is notified when the item is released", () => {
  const waiting = as("Adam", itemRequest("Adam"), { arm: "Eva" });
  expect(hasRequested(waiting, "arm")).toBe(true);
  expect(hasRequested(as("Eva", itemRequest("Adam"), {}), "arm")).toBe(false);
  expect(handOver({ ...waiting, locks: { box: "Eva" } }, waiting, AT)).toEqual({ wanted: [], free: ["arm"] });
  expect(handOver({ ...waiting, locks: { arm: "Berta" } }, waiting, AT).free).toEqual([]);
});
