/** Completion and signatures for the text editor. */

import { autocompletion, type Completion, type CompletionSource, snippetCompletion } from "@codemirror/autocomplete";
import { type EditorState, type Extension, StateField } from "@codemirror/state";
import { showTooltip, type Tooltip } from "@codemirror/view";
import { getState } from "../../store/store";
import { type Offer, offersAt, parameterWords, resultWords, type Signature, signatureAt } from "./offers";

/** Priority of completions whose type is that of the parameter. */
const FITS = 50;

const complete: CompletionSource = ({ state, pos, explicit }) => {
  const { doc, types } = getState();
  const found = doc && offersAt(state.doc.toString(), pos, doc, types);
  if (!found || (!explicit && found.from === pos && !/[.(]\s*$|, ?$/.test(state.sliceDoc(Math.max(0, pos - 3), pos))))
    return null;
  return { from: found.from, options: found.offers.map(completion), validFor: /^\w*$/ };
};

function completion({ label, type, detail, info, snippet, fits }: Offer): Completion {
  const shown = { label, type, detail, ...(info && { info }), ...(fits && { boost: FITS }) };
  return snippet === undefined ? shown : snippetCompletion(snippet, shown);
}

function tooltip(state: EditorState): Tooltip | null {
  const { from, to } = state.selection.main; // a field of a call that was inserted is selected
  const { doc, types } = getState();
  if (state.readOnly || !doc || to > state.doc.lineAt(from).to) return null;
  const found = signatureAt(state.doc.toString(), from, doc, types);
  return found && { pos: found.at, above: true, create: () => ({ dom: elementOf(found) }) };
}

function elementOf({ action, active }: Signature): HTMLElement {
  const dom = document.createElement("div");
  dom.className = "cm-signature";
  dom.append(`${action.name}(`);
  action.parameters.forEach((each, n) => {
    const part = document.createElement(n === active ? "strong" : "span");
    part.textContent = parameterWords(each);
    dom.append(n === 0 ? "" : ", ", part);
  });
  dom.append(`)${resultWords(action)}`);
  const about = action.parameters[active]?.description ?? action.description?.split("\n")[0];
  if (about) {
    const line = document.createElement("div");
    line.className = "quiet small";
    line.textContent = about;
    dom.append(line);
  }
  return dom;
}

const signatures = StateField.define<Tooltip | null>({
  create: () => null,
  update: (value, { state, docChanged, selection }) => (docChanged || selection ? tooltip(state) : value),
  provide: (field) => showTooltip.from(field),
});

/** Return the extensions that complete names and show the signature of the call at the cursor. */
export const completionExtensions = (): Extension => [
  autocompletion({ override: [complete], icons: false, maxRenderedOptions: 60 }),
  signatures,
];
