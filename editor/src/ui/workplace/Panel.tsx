/**
 * The panel on the right: the open tool, or sections about the selected item. On narrow screens it is a bottom sheet.
 */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { Suspense, useState } from "react";
import { select, setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Button, Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { SECTIONS } from "./sections";
import { TOOLS } from "./tools";

const Neighbours = lazyComponent(() => import("../things/Neighbours"));

export default function Panel() {
  const toolId = useEditor((state) => state.ui.tool);
  const selection = useEditor((state) => state.ui.selection);
  const title = useEditor((state) => (selection ? nameOf(state, selection.id) : ""));
  const [tall, setTall] = useState(false);
  const tool = TOOLS.find((each) => each.id === toolId);
  const heading = tool ? i18n._(tool.label) : title;
  const close = () => (tool ? setUi({ tool: "" }) : select(null));
  return (
    <aside className="panel" data-tall={tall} aria-label={heading}>
      <button type="button" className="panel-grip" aria-expanded={tall} onClick={() => setTall(!tall)}>
        <span className="hidden-but-read">{tall ? t`Shrink the panel` : t`Enlarge the panel`}</span>
      </button>
      <header>
        <h2>{heading}</h2>
        {!tool && selection && (
          <Suspense fallback={null}>
            <Neighbours id={selection.id} />
          </Suspense>
        )}
        <Button variant="plain" icon="close" aria-label={t`Close the panel`} onPress={close} />
      </header>
      <div className="panel-body">
        {/** A boundary for each tool: the state of the last tool must not stay while the next one is loading. */}
        <Suspense key={toolId} fallback={<Waiting>{t`Loading…`}</Waiting>}>
          {tool ? <tool.Panel /> : selection && <Sections />}
        </Suspense>
      </div>
    </aside>
  );
}

function Sections() {
  const state = useEditor((each) => each);
  const { selection } = state.ui;
  if (!selection) return null;
  return SECTIONS.filter((each) => each.applies(selection, state)).map(({ id, title, Body }) => (
    <section key={id} className="section" data-section={id} aria-label={i18n._(title)}>
      <h3>{i18n._(title)}</h3>
      <Body selection={selection} />
    </section>
  ));
}
