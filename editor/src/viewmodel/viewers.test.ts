import { expect, test } from "vitest";
import type { State } from "../store/state";
import { viewersOf } from "./viewers";

const camera = { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
const user = (name: string, document: string, more = {}) => ({
  user: name,
  online: true,
  presence: { document, selected: [], view: "ar", camera },
  ...more,
});

test("only other users who are in AR in the same document have a camera in the view", () => {
  const users = {
    Adam: user("Adam", "scene"),
    Eva: user("Eva", "scene"),
    Bob: user("Bob", "another"),
    Gina: user("Gina", "scene", { online: false }),
    Tom: user("Tom", "scene", { presence: { document: "scene", selected: [], view: "3d" } }),
    Ann: { user: "Ann", online: true },
  };
  const state = { users, connection: { user: "Eva" }, doc: { scene: { id: "scene" } } } as unknown as State;
  expect(viewersOf(state)).toEqual([{ user: "Adam", camera }]);
});
