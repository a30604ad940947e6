/** The text editor: CodeMirror with Python, breakpoints, and the selection and running actions of the program. */

import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { python } from "@codemirror/lang-python";
import {
  codeFolding,
  foldEffect,
  foldGutter,
  foldKeymap,
  foldService,
  HighlightStyle,
  indentOnInput,
  indentUnit,
  syntaxHighlighting,
} from "@codemirror/language";
import { type Diagnostic, forceLinting, linter, lintGutter } from "@codemirror/lint";
import { search, searchKeymap } from "@codemirror/search";
import {
  Compartment,
  EditorState,
  type Extension,
  RangeSet,
  StateEffect,
  StateField,
  Transaction,
} from "@codemirror/state";
import {
  Decoration,
  type DecorationSet,
  drawSelection,
  EditorView,
  GutterMarker,
  gutter,
  highlightActiveLine,
  keymap,
  lineNumbers,
  WidgetType,
} from "@codemirror/view";
import { tags } from "@lezer/highlight";
import { t } from "@lingui/core/macro";
import { completionExtensions } from "./completion";
import { actionsOf, boilerplate, idsOf, type ScriptAction } from "./script";

/** The marks at the lines of a script, by name of the action. */
export interface Marks {
  selected: string;
  running: readonly string[];
  breakpoints: ReadonlySet<string>;
  /** Return the name of an item by its id; an empty string if it is unknown. */
  nameOf: (id: string) => string;
}

/** Callbacks of the editor. */
export interface Handlers {
  onEdit: (text: string) => void;
  onAction: (name: string) => void;
  onBreakpoint: (name: string) => void;
  check: (text: string) => Promise<Diagnostic[]>;
}

const COLOURS = HighlightStyle.define([
  { tag: [tags.keyword, tags.bool, tags.null, tags.operatorKeyword], color: "var(--accent)", fontWeight: "700" },
  { tag: [tags.string, tags.special(tags.string)], color: "var(--good)" },
  { tag: tags.number, color: "var(--warn)" },
  { tag: tags.comment, color: "var(--ink-2)", fontStyle: "italic" },
]);

const setMarks = StateEffect.define<Marks>();
const NO_MARKS: Marks = { selected: "", running: [], breakpoints: new Set(), nameOf: () => "" };

class NameWidget extends WidgetType {
  constructor(private readonly name: string) {
    super();
  }
  override eq(other: NameWidget): boolean {
    return other.name === this.name;
  }
  override toDOM(): HTMLElement {
    const element = document.createElement("span");
    element.className = "cm-name";
    element.textContent = this.name;
    return element;
  }
}

class BreakpointMarker extends GutterMarker {
  constructor(
    private readonly name: string,
    private readonly on: boolean,
  ) {
    super();
  }
  override eq(other: BreakpointMarker): boolean {
    return other.name === this.name && other.on === this.on;
  }
  override toDOM(): HTMLElement {
    const element = document.createElement("span");
    element.className = "breakpoint-dot";
    element.dataset.on = String(this.on);
    element.title = t`Pause before ${this.name}`;
    return element;
  }
}

interface Lines {
  marks: Marks;
  actions: ScriptAction[];
  decorations: DecorationSet;
  names: DecorationSet;
  breakpoints: RangeSet<GutterMarker>;
}

function linesOf(state: EditorState, marks: Marks): Lines {
  const source = state.doc.toString();
  const actions = actionsOf(source);
  const decorations = actions
    .filter(({ name }) => name === marks.selected || marks.running.includes(name))
    .map(({ name, from }) =>
      Decoration.line({
        attributes: {
          "data-selected": String(name === marks.selected),
          "data-running": String(marks.running.includes(name)),
        },
      }).range(from),
    );
  const names = idsOf(source).flatMap(({ id, from, to }) => {
    const name = marks.nameOf(id);
    return name ? [Decoration.replace({ widget: new NameWidget(name) }).range(from, to)] : [];
  });
  const first = actions.filter((each, index) => each.from !== actions[index - 1]?.from);
  return {
    marks,
    actions,
    decorations: Decoration.set(decorations, true),
    names: Decoration.set(names),
    breakpoints: RangeSet.of(
      first.map(({ name, from }) => new BreakpointMarker(name, marks.breakpoints.has(name)).range(from)),
      true,
    ),
  };
}

const lines = StateField.define<Lines>({
  create: (state) => linesOf(state, NO_MARKS),
  update(value, transaction) {
    const marked = transaction.effects.find((each) => each.is(setMarks));
    return marked || transaction.docChanged ? linesOf(transaction.state, marked?.value ?? value.marks) : value;
  },
  provide: (field) => [
    EditorView.decorations.from(field, (value) => value.decorations),
    EditorView.decorations.from(field, (value) => value.names),
    EditorView.atomicRanges.of((view) => view.state.field(field).names),
  ],
});

/** Return the name of the action whose call is on the line at a position; an empty string if there is none. */
const actionAt = (state: EditorState, at: number): string => {
  const { from, to } = state.doc.lineAt(at);
  return state.field(lines).actions.find((each) => each.from <= to && from <= each.to)?.name ?? "";
};

const folding = foldService.of((state, from, to) => {
  const found = boilerplate(state.doc.toString()).find((each) => each.from >= from && each.from <= to);
  return found ?? null;
});

/** Return the extensions that let the user edit, or only read. */
const editing = (allowed: boolean): Extension =>
  allowed ? [] : [EditorState.readOnly.of(true), EditorView.editable.of(false)];

/** Return the extensions of every view of a script, also of the comparison. */
export const appearance = (): Extension => [
  python(),
  syntaxHighlighting(COLOURS),
  EditorView.cspNonce.of(document.querySelector<HTMLMetaElement>('meta[property="csp-nonce"]')?.nonce ?? ""),
  EditorState.phrases.of({
    "Fold line": t`Fold`,
    "Unfold line": t`Unfold`,
    "folded code": t`Folded code`,
    unfold: t`Unfold`,
    "Go to line": t`Go to line`,
    go: t`Go`,
    Find: t`Find`,
    Replace: t`Replace`,
    next: t`Next`,
    previous: t`Previous`,
    all: t`All`,
    "match case": t`Match case`,
    "by word": t`Whole words`,
    regexp: t`Pattern`,
    replace: t`Replace`,
    "replace all": t`Replace all`,
    close: t`Close`,
    Completions: t`Suggestions`,
    // The library puts the number in place of the sign.
    "$ unchanged lines": t`${"$"} unchanged lines`,
  }),
];

/** The text editor in a page. */
export class CodeMirror {
  readonly view: EditorView;
  /** Whether `load` is replacing the text. Such a change is not reported as an edit of the user. */
  private loading = false;
  private readonly editable = new Compartment();

  constructor(parent: HTMLElement, text: string, handlers: Handlers, extensions: Extension = []) {
    const state = EditorState.create({
      doc: text,
      extensions: [
        appearance(),
        lines,
        gutter({
          class: "cm-breakpoints",
          markers: (view) => view.state.field(lines).breakpoints,
          domEventHandlers: {
            click: (view, block) => {
              const name = actionAt(view.state, block.from);
              if (name) handlers.onBreakpoint(name);
              return name !== "";
            },
          },
        }),
        lineNumbers(),
        lintGutter(),
        foldGutter(),
        codeFolding(),
        folding,
        history(),
        drawSelection(),
        highlightActiveLine(),
        indentOnInput(),
        indentUnit.of("    "),
        search({ top: true }),
        completionExtensions(),
        linter((view) => handlers.check(view.state.doc.toString()), { delay: 600 }),
        keymap.of([...searchKeymap, ...foldKeymap, ...historyKeymap, ...defaultKeymap]),
        this.editable.of(editing(false)),
        EditorView.contentAttributes.of({ "aria-label": t`Python program`, tabindex: "0" }),
        EditorView.updateListener.of((update) => {
          if (update.docChanged && !this.loading) handlers.onEdit(update.state.doc.toString());
        }),
        EditorView.domEventHandlers({
          click: (event, view) => {
            const at = view.posAtCoords(event);
            const name = at === null || !view.state.selection.main.empty ? "" : actionAt(view.state, at);
            if (name) handlers.onAction(name);
          },
        }),
        extensions,
      ],
    });
    this.view = new EditorView({ parent, state });
    this.fold();
  }

  /** Replace the text by another version of the script. */
  load(text: string): void {
    if (text === this.text) return;
    this.loading = true;
    this.view.dispatch({
      changes: { from: 0, to: this.view.state.doc.length, insert: text },
      annotations: Transaction.addToHistory.of(false),
    });
    this.loading = false;
    this.fold();
  }

  get text(): string {
    return this.view.state.doc.toString();
  }

  allow(allowed: boolean): void {
    this.view.dispatch({ effects: this.editable.reconfigure(editing(allowed)) });
  }

  mark(marks: Marks): void {
    this.view.dispatch({ effects: setMarks.of(marks) });
  }

  /** Show a line. */
  show(line: number): void {
    const { doc } = this.view.state;
    const at = doc.line(Math.min(Math.max(line, 1), doc.lines)).from;
    this.view.dispatch({ selection: { anchor: at }, effects: EditorView.scrollIntoView(at, { y: "center" }) });
    this.view.focus();
  }

  /** Show the first line of an action. */
  showAction(name: string): void {
    const found = this.view.state.field(lines).actions.find((each) => each.name === name);
    if (found) this.view.dispatch({ effects: EditorView.scrollIntoView(found.from, { y: "nearest", yMargin: 40 }) });
  }

  /** Check the text now. */
  check(): void {
    forceLinting(this.view);
  }

  private fold(): void {
    const effects = boilerplate(this.text).map((each) => foldEffect.of(each));
    if (effects.length > 0) this.view.dispatch({ effects });
  }
}
