/** The program as a graph. The selection is shared with the other views; a running program is followed. */

import { t } from "@lingui/core/macro";
import {
  Background,
  ControlButton,
  Controls,
  type Edge,
  MarkerType,
  MiniMap,
  ReactFlow,
  ReactFlowProvider,
  useStore,
} from "@xyflow/react";
import { useMemo, useRef } from "react";
import "@xyflow/react/dist/base.css";
import { addErrorExit } from "../../commands/errorExits";
import { pickAction, startPicking } from "../../commands/functions";
import { connect, finishConnecting, notEditable, removeAction, removeStep } from "../../commands/program";
import { cannotLead } from "../../program/logic";
import { problemsHere, problemsOf } from "../../program/problems";
import { placeOf } from "../../program/steps";
import { takenExit } from "../../program/takenExit";
import { scopeOf } from "../../store/scope";
import { getState, notify, select, setUi, useEditor } from "../../store/store";
import { selectionOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { inColumns } from "./columns";
import { conditionOf, ERROR_HANDLE, FlowNode, type FlowNodeType } from "./FlowNode";
import { foldAll, unfold, useFolds } from "./folding";
import { type Box, firstIn, graphOf, lastIn } from "./graph";
import { usePressed } from "./usePressed";
import { useViewport } from "./useViewport";
import { SMALLEST } from "./viewport";
import { WrappedEdge } from "./WrappedEdge";
import "../program/program.css";
import "./flow.css";

const NODE_TYPES = { box: FlowNode };
const EDGE_TYPES = { wrapped: WrappedEdge };
/** Steps in which the layout follows the size of the view, pixels. */
const COARSE = 40;
const COLOURS = {
  always: "var(--ink-2)",
  true: "var(--good)",
  false: "var(--warn)",
  value: "var(--accent)",
  error: "var(--bad)",
} as const;
/** Return the name shown at a node of the graph. */
const nameIn = (graph: { boxes: Box[] }, id: string): string => graph.boxes.find((each) => each.id === id)?.name ?? "";

const DASHES = { always: undefined, true: "14 4", false: "3 5", value: "9 6", error: "12 4 2 4" } as const;

/** Return the handler of taps on nodes and connections. */
function useChoose(): (box: Pick<Box, "id" | "kind" | "run">) => void {
  /** The node that ended a connection: the graph reports one tap twice, as a tap and as a selection. */
  const ended = useRef("");
  return (box) => {
    const id = firstIn(box);
    if (getState().ui.connecting) {
      if (selectionOf(getState(), id)?.kind === "logic") return;
      ended.current = id;
      setTimeout(() => (ended.current = ""));
      void finishConnecting(id);
      return;
    }
    if (ended.current === id) return;
    if (getState().ui.picked) {
      ended.current = id;
      setTimeout(() => (ended.current = ""));
      for (const each of box.kind === "fold" ? box.run : [id]) pickAction(each);
      return;
    }
    if (box.kind === "fold") return unfold(box.run);
    select(selectionOf(getState(), id));
    setUi({ tool: "" });
  };
}

export default function FlowView() {
  return (
    <ReactFlowProvider>
      <Flow />
    </ReactFlowProvider>
  );
}

function Flow() {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const running = useEditor((state) => state.program.running);
  const picked = useEditor((state) => state.ui.picked);
  const executing = useEditor((state) => state.live.executing);
  const paused = useEditor((state) => state.program.state === "paused");
  const breakpoints = useEditor((state) => state.breakpoints);
  const selected = useEditor((state) => state.ui.selection?.id ?? "");
  const exit = useEditor((state) => takenExit(state)?.id);
  const connecting = useEditor((state) => state.ui.connecting);
  const dark = useEditor((state) => state.ui.theme === "dark" || (state.ui.theme === "system" && state.ui.systemDark));
  const reach = useEditor((state) => state.reach);
  const problems = useMemo(() => problemsHere(doc, doc ? problemsOf(doc, types, reach) : []), [doc, types, reach]);
  const folds = useFolds(problems);
  const latest = useMemo(
    () => (doc ? graphOf(doc, types, folds.folded) : { boxes: [], lines: [] }),
    [doc, types, folds.folded],
  );
  const choose = useChoose();
  const host = useRef<HTMLDivElement>(null);
  const width = useStore((state) => Math.floor(state.width / COARSE) * COARSE);
  const height = useStore((state) => Math.floor(state.height / COARSE) * COARSE);
  const wrapped = useMemo(() => inColumns(latest, { width, height }), [latest, width, height]);
  const box = (id: string): Pick<Box, "id" | "kind" | "run" | "branches"> =>
    graph.boxes.find((each) => each.id === id) ?? { id, kind: "action", run: [], branches: [] };
  const graph = usePressed(host, wrapped, (id) => choose(box(id)));

  const nodes = graph.boxes.map(
    (box): FlowNodeType => ({
      id: box.id,
      type: "box",
      position: { x: box.x, y: box.y },
      width: box.width,
      height: box.height,
      selected: box.id === selected,
      ariaLabel: [box.kind === "fold" ? t`${box.name}, folded` : box.name, box.detail].filter(Boolean).join(", "),
      data: {
        box,
        running: running.includes(box.id) || executing === box.id,
        paused,
        breakpoint: box.id in breakpoints,
        fault: problems.find((each) => each.id === box.id)?.text ?? "",
        target:
          connecting !== null &&
          doc !== null &&
          cannotLead(doc, connecting.from, firstIn(box), connecting.item, connecting.error || undefined) === "",
        from: connecting?.from === lastIn(box),
        picked: picked?.includes(firstIn(box)) ?? false,
      },
    }),
  );
  const edges = graph.lines.map((line): Edge => {
    const taken = line.id === exit;
    const colour = line.id === selected ? "#ff9500" : COLOURS[line.branch];
    return {
      id: line.id,
      source: line.from,
      ...(line.branch === "error" && { sourceHandle: ERROR_HANDLE }),
      target: line.to,
      ...(graph.detours.has(line.id)
        ? { type: "wrapped", data: { detour: graph.detours.get(line.id) } }
        : { type: "smoothstep" }),
      label: line.words || undefined,
      selected: line.id === selected,
      className: `flow-line ${line.branch}${taken ? " taken" : ""}`,
      interactionWidth: 44,
      ariaLabel: [
        t`Step from ${nameIn(graph, line.from)} to ${nameIn(graph, line.to)}`,
        line.words,
        taken ? t`taken` : "",
      ]
        .filter(Boolean)
        .join(", "),
      markerEnd: { type: MarkerType.ArrowClosed, color: colour, width: 20, height: 20 },
      style: {
        stroke: colour,
        strokeWidth: line.id === selected || taken ? 5 : 2.5,
        strokeDasharray: DASHES[line.branch],
      },
    };
  });

  const step = doc?.logic[selected];
  const runs = running.findLast((id) => doc !== null && id in doc.actions) ?? executing;
  const { moved, whole } = useViewport(
    graph.boxes,
    runs,
    step ? placeOf(step.start) : selected,
    doc ? scopeOf(doc) : "",
  );

  return (
    <div className="flow" role="region" aria-label={t`Program graph`} ref={host}>
      <ReactFlow<FlowNodeType>
        nodes={nodes}
        edges={edges}
        nodeTypes={NODE_TYPES}
        edgeTypes={EDGE_TYPES}
        colorMode={dark ? "dark" : "light"}
        nodesDraggable={false}
        connectOnClick={false}
        deleteKeyCode={["Delete", "Backspace"]}
        minZoom={SMALLEST}
        maxZoom={2}
        onMove={(event) => event && moved()}
        ariaLabelConfig={{
          "controls.ariaLabel": t`View`,
          "controls.fitView.ariaLabel": t`Show everything`,
          "controls.zoomIn.ariaLabel": t`Zoom in`,
          "controls.zoomOut.ariaLabel": t`Zoom out`,
        }}
        isValidConnection={({ source, target, sourceHandle }) =>
          doc !== null &&
          cannotLead(doc, lastIn(box(source)), firstIn(box(target)), "", sourceHandle === "error") === ""
        }
        onConnect={({ source, target, sourceHandle }) => {
          const why = notEditable(getState(), "AddLogicItem");
          if (why) return notify("info", why);
          if (sourceHandle === "error") return void addErrorExit(lastIn(box(source)), firstIn(box(target)));
          const branch = box(source).branches.find((each) => each.id === sourceHandle);
          void connect(lastIn(box(source)), firstIn(box(target)), branch && conditionOf(branch));
        }}
        onNodeClick={({ target }, { id }) => {
          const call = (target as Element).closest<HTMLElement>("[data-call]")?.dataset.call;
          if (call === undefined || getState().ui.connecting || getState().ui.picked) return choose(box(id));
          select({ kind: "action", id: call });
          setUi({ tool: "" });
        }}
        onEdgeClick={(_, { id }) => choose({ id, kind: "action", run: [] })}
        onPaneClick={() => (getState().ui.connecting ? setUi({ connecting: null }) : select(null))}
        onNodesChange={(changes) => {
          // Enter selects the focused node.
          for (const change of changes)
            if (change.type === "select" && change.selected && change.id !== getState().ui.selection?.id)
              choose(box(change.id));
        }}
        onDelete={({ nodes: gone, edges: lines }) =>
          void remove(
            gone.map((each) => each.id),
            lines.map((each) => each.id),
          )
        }
        proOptions={{ hideAttribution: true }}
      >
        <Background gap={24} />
        <MiniMap
          pannable
          zoomable
          position="bottom-right"
          ariaLabel={t`Overview of the program`}
          nodeClassName={({ data }: FlowNodeType) => `flow-mini ${data.running ? "running" : data.box.kind}`}
          nodeBorderRadius={12}
        />
        <Controls showInteractive={false} showFitView={false} position="bottom-left">
          <ControlButton aria-label={t`Show the whole program`} onClick={whole}>
            <Icon name="zoom" />
          </ControlButton>
          {doc && Object.keys(doc.actions).length > 0 && !picked && (
            <ControlButton
              className="flow-fold-all"
              aria-label={t`Select several actions`}
              onClick={() => startPicking()}
            >
              {t`Select`}
            </ControlButton>
          )}
          {folds.runs > 0 && (
            <ControlButton
              className="flow-fold-all"
              aria-label={folds.chosen ? t`Unfold all` : t`Fold sequences`}
              onClick={() => foldAll(!folds.chosen)}
            >
              {folds.chosen ? t`Unfold` : t`Fold`}
            </ControlButton>
          )}
        </Controls>
      </ReactFlow>
    </div>
  );
}

/** Remove only the selected node: the command removes its connections. */
async function remove(nodes: string[], lines: string[]): Promise<void> {
  const why = notEditable(getState(), "RemoveAction");
  if (why) return notify("info", why);
  const { doc } = getState();
  for (const id of nodes) if (doc && id in doc.actions) await removeAction(id);
  if (nodes.length === 0) for (const id of lines) await removeStep(id);
}
