/** The store of the editor, and the hook by which React reads it. */

import { useStore } from "zustand";
import { createStore } from "zustand/vanilla";
import type { ServerEvent } from "../protocol/types";
import { notice, reduce } from "./reduce";
import { inScope, pathTo } from "./scope";
import { type Connection, initialState, type Notice, type State } from "./state";
import type { FormDraft, Selection, Ui } from "./ui";

export const store = createStore<State>(initialState);

/** Return a part of the state; the component is rendered again when that part changes. */
export function useEditor<T>(select: (state: State) => T): T {
  return useStore(store, select);
}

export const getState = (): State => store.getState();

export function applyEvent(event: ServerEvent): void {
  store.setState((state) => reduce(state, event, Date.now()));
}

export function setConnection(change: Partial<Connection>): void {
  store.setState((state) => ({ connection: { ...state.connection, ...change } }));
}

export function setUi(change: Partial<Ui>): void {
  store.setState((state) => ({ ui: { ...state.ui, ...change } }));
}

/** Store the unsaved form of an object or type; null removes it after it was saved or reverted. */
export function keepForm(key: string, draft: FormDraft | null): void {
  const { [key]: _, ...others } = getState().ui.forms;
  setUi({ forms: draft ? { ...others, [key]: draft } : others });
}

/** Select an item. An action or connection is shown in the program or function that contains it. */
export function select(selection: Selection | null): void {
  const { doc } = getState();
  const inside = selection?.kind === "action" || selection?.kind === "logic";
  const path = inside && doc ? pathTo(doc, selection.id) : undefined;
  if (path && path !== doc?.path) showFunction(path);
  setUi({ selection });
}

/** Show the last function of a path of nested functions in all views; the program if the path is empty. */
export function showFunction(path: readonly string[]): void {
  store.setState(({ doc, ui }) => ({
    doc: doc && inScope(doc, path),
    ui: { ...ui, selection: null, connecting: null, picked: null },
  }));
}

export function notify(level: Notice["level"], text: string): void {
  store.setState((state) => notice(state, level, text, Date.now()));
}

export function dismiss(id: number): void {
  store.setState((state) => ({ notices: state.notices.filter((each) => each.id !== id) }));
}
