/** The right side: the open tool, or the selected thing in sections. On a narrow screen it is a sheet from below. */

import { Suspense, useState } from "react";
import { select, setUi, useEditor } from "../../store/store";
import { Button, Waiting } from "../kit/kit";
import { lazily } from "../kit/lazily";
import { nameOf } from "../names";
import { SECTIONS } from "./sections";
import { TOOLS } from "./tools";

const Neighbours = lazily(() => import("../things/Neighbours"));

export default function Panel() {
  const toolId = useEditor((state) => state.ui.tool);
  const selection = useEditor((state) => state.ui.selection);
  const title = useEditor((state) => (selection ? nameOf(state, selection.id) : ""));
  const [tall, setTall] = useState(false);
  const tool = TOOLS.find((each) => each.id === toolId);
  const close = () => (tool ? setUi({ tool: "" }) : select(null));
  return (
    <aside className="panel" data-tall={tall} aria-label={tool?.label ?? title}>
      <button type="button" className="panel-grip" aria-expanded={tall} onClick={() => setTall(!tall)}>
        <span className="hidden-but-read">{tall ? "Make the panel smaller" : "Make the panel larger"}</span>
      </button>
      <header>
        <h2>{tool?.label ?? title}</h2>
        {!tool && selection && (
          <Suspense fallback={null}>
            <Neighbours id={selection.id} />
          </Suspense>
        )}
        <Button look="plain" icon="close" aria-label="Close the panel" onPress={close} />
      </header>
      <div className="panel-body">
        <Suspense fallback={<Waiting>Loading…</Waiting>}>{tool ? <tool.Panel /> : selection && <Sections />}</Suspense>
      </div>
    </aside>
  );
}

function Sections() {
  const state = useEditor((each) => each);
  const { selection } = state.ui;
  if (!selection) return null;
  return SECTIONS.filter((each) => each.applies(selection, state)).map(({ id, title, Body }) => (
    <section key={id} className="section" aria-label={title}>
      <h3>{title}</h3>
      <Body selection={selection} />
    </section>
  ));
}
