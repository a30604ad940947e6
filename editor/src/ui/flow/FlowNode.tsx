/** An action in the graph with its free branches: tap one, then the next action; or drag. */

import { t } from "@lingui/core/macro";
import { Handle, type Node, type NodeProps, Position } from "@xyflow/react";
import { notEditable, startConnecting } from "../../commands/program";
import { detailOf } from "../../program/functions";
import { lanesOf } from "../../program/lanes";
import type { Action } from "../../protocol/types";
import type { OnPoint } from "../../store/state";
import { getState, notify, useEditor } from "../../store/store";
import { deviceIcon } from "../kit/deviceIcons";
import { Drawing, Icon } from "../kit/icons";
import { ReachBadge } from "../points/Reach";
import { type Box, type Branch, lastIn } from "./graph";

export type FlowNodeType = Node<
  {
    box: Box;
    running: boolean;
    breakpoint: boolean;
    paused: boolean;
    fault: string;
    target: boolean;
    from: boolean;
    picked: boolean;
  },
  "box"
>;

/** The connection point of a node for error exits. */
export const ERROR_HANDLE = "fails";

const onError = (): Branch => ({ id: "error", label: t`On error` });

export function FlowNode({ data, selected }: NodeProps<FlowNodeType>) {
  const { box, running, paused, breakpoint, fault, target, from, picked } = data;
  return (
    <div
      className={`flow-node ${box.kind} ${box.called ? "call" : box.lanes ? "parallel" : ""}`}
      data-running={running}
      data-target={target}
      data-from={from}
      data-picked={picked}
    >
      {box.kind !== "start" && (
        <Handle type="target" position={Position.Top} className="flow-into" isConnectableStart={false} aria-hidden />
      )}
      <div className="flow-name">
        {box.kind === "fold" && <Icon name="list" size={18} />}
        {box.called || box.lanes ? (
          <Icon name={box.lanes ? "parallel" : "function"} size={18} />
        ) : (
          box.kind === "action" && <Drawing path={deviceIcon(box)} size={18} />
        )}
        {breakpoint && <span className="breakpoint-dot" data-on="true" role="img" aria-label={t`pauses here`} />}
        <span className="flow-title">{box.name}</span>
        {box.kind === "action" && <ReachBadge id={box.id} />}
        {running && <span className="tag good">{paused ? t`next` : t`runs`}</span>}
        {picked && <Icon name="check" size={18} />}
        {fault && (
          <span className="flow-fault" role="img" aria-label={fault} title={fault}>
            <Icon name="warn" size={16} />
          </span>
        )}
      </div>
      {box.lanes && (
        <ul className="flow-lanes">
          {box.lanes.map((call) => (
            <Lane key={call.id} call={call} />
          ))}
        </ul>
      )}
      {box.detail && <div className="quiet small flow-detail">{box.detail}</div>}
      {box.values && <div className="small flow-values">{box.values}</div>}
      <div className="flow-branches">
        {box.branches.map((branch) => (
          <BranchHandle key={branch.id} id={lastIn(box)} name={box.name} branch={branch} />
        ))}
        {box.branches.length === 0 && box.kind !== "end" && (
          <Handle type="source" position={Position.Bottom} className="flow-none" isConnectable={false} aria-hidden />
        )}
      </div>
      {(box.kind === "action" || box.kind === "fold") && (
        <>
          <Handle
            id={ERROR_HANDLE}
            type="source"
            position={Position.Right}
            className="flow-none"
            isConnectable={false}
            aria-hidden
          />
          {selected && box.kind === "action" && <BranchHandle id={box.id} name={box.name} branch={onError()} />}
        </>
      )}
    </div>
  );
}

/** A call that parallel work runs: what it does now. The graph selects it at a tap. */
function Lane({ call }: { call: OnPoint<Action> }) {
  const running = useEditor((state) => state.program.running.includes(call.id));
  const waits = useEditor((state) => state.program.state === "paused");
  const doing = useEditor((state) => lanesOf(state).find((each) => each.id === call.id)?.doing ?? "");
  const detail = useEditor((state) => (state.doc ? detailOf(state.doc, call) : ""));
  const selected = useEditor((state) => state.ui.selection?.id === call.id);
  const breakpoint = useEditor((state) => call.id in state.breakpoints);
  return (
    <li className="flow-lane" data-call={call.id} data-running={running} data-selected={selected}>
      <span className="flow-name">
        {breakpoint && <span className="breakpoint-dot" data-on="true" role="img" aria-label={t`pauses here`} />}
        <span className="flow-title">{call.name}</span>
        {running && <span className="tag good">{waits ? t`next` : t`runs`}</span>}
      </span>
      <span className="quiet small flow-detail">{running && doing ? doing : detail}</span>
    </li>
  );
}

/** A free branch, or the exit of errors. */
function BranchHandle({ id, name, branch }: { id: string; name: string; branch: Branch }) {
  return (
    <Handle
      id={branch.id}
      type="source"
      position={branch.id === "error" ? Position.Right : Position.Bottom}
      className={`flow-branch ${branch.id}`}
      role="button"
      tabIndex={0}
      aria-label={`${name}: ${branch.label}`}
      onClick={(event) => {
        event.stopPropagation();
        startConnection(id, branch);
      }}
      onKeyDown={(event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.stopPropagation();
        startConnection(id, branch);
      }}
    >
      {branch.label}
    </Handle>
  );
}

export function conditionOf(branch: Branch) {
  return branch.what && (branch.id === "true" || branch.id === "false")
    ? { what: branch.what, value: branch.id }
    : undefined;
}

function startConnection(id: string, branch: Branch): void {
  const why = notEditable(getState(), "AddLogicItem");
  if (why) notify("info", why);
  else startConnecting(id, conditionOf(branch), undefined, branch.id === "error");
}
