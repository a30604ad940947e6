import { expect, test } from "vitest";
import { absentLockHolders, usersOfDocument } from "./absentUsers";
import { initialState, type State } from "./state";

function state(users: State["users"], locks: Record<string, string> = {}): State {
  const start = initialState();
  const doc = { scene: { id: "scn" }, project: { id: "pro" } } as State["doc"];
  return { ...start, connection: { ...start.connection, user: "Olga", status: "ready" }, users, locks, doc };
}
const user = (name: string, role: string, document?: string) => ({
  [name]: {
    user: name,
    online: true,
    role,
    ...(document === undefined ? {} : { presence: { document, selected: [], view: "" } }),
  },
});

test("a disconnected user who holds locks is absent", () => {
  const users = user("Eva", "programmer");
  expect(absentLockHolders(state(users, { arm: "Eva", box: "Adam", lid: "Adam", tip: "Olga" }))).toEqual(["Adam"]);
  const joining = state(users, { box: "Adam" });
  expect(absentLockHolders({ ...joining, connection: { ...joining.connection, status: "joining" } })).toEqual([]);
});

test("users have the document open if they report it, hold a lock, or report nothing and may edit", () => {
  const users = {
    ...user("Eva", "programmer", "pro"),
    ...user("Ada", "operator", "scn"),
    ...user("Bob", "programmer", ""),
    ...user("Old", "standard_user"),
    ...user("Panel", "operator"),
    ...user("Holder", "programmer", ""),
    ...user("Olga", "programmer", "pro"),
  };
  expect(usersOfDocument(state(users, { arm: "Holder", box: "Adam" }))).toEqual(["Ada", "Eva", "Holder", "Old"]);
  expect(usersOfDocument({ ...state(users), doc: null })).toEqual([]);
});
