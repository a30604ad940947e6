/** An action in the graph with its free branches: tap one, then the next action; or drag. */

import { t } from "@lingui/core/macro";
import { Handle, type Node, type NodeProps, Position } from "@xyflow/react";
import { notEditable, startConnecting } from "../../commands/program";
import { notify, now } from "../../store/store";
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

/** Where error exits leave a node. */
export const FAILS = "fails";

const onError = (): Branch => ({ id: "error", label: t`On error` });

export function FlowNode({ data, selected }: NodeProps<FlowNodeType>) {
  const { box, running, paused, breakpoint, fault, target, from, picked } = data;
  return (
    <div
      className={`flow-node ${box.kind} ${box.called ? "call" : ""}`}
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
        {box.called ? (
          <Icon name="function" size={18} />
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
      {box.detail && <div className="quiet small flow-detail">{box.detail}</div>}
      {box.values && <div className="small flow-values">{box.values}</div>}
      <div className="flow-branches">
        {box.branches.map((branch) => (
          <Out key={branch.id} id={lastIn(box)} name={box.name} branch={branch} />
        ))}
        {box.branches.length === 0 && box.kind !== "end" && (
          <Handle type="source" position={Position.Bottom} className="flow-none" isConnectable={false} aria-hidden />
        )}
      </div>
      {(box.kind === "action" || box.kind === "fold") && (
        <>
          <Handle
            id={FAILS}
            type="source"
            position={Position.Right}
            className="flow-none"
            isConnectable={false}
            aria-hidden
          />
          {selected && box.kind === "action" && <Out id={box.id} name={box.name} branch={onError()} />}
        </>
      )}
    </div>
  );
}

/** A free branch, or the exit of errors. */
function Out({ id, name, branch }: { id: string; name: string; branch: Branch }) {
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
        begin(id, branch);
      }}
      onKeyDown={(event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.stopPropagation();
        begin(id, branch);
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

function begin(id: string, branch: Branch): void {
  const why = notEditable(now(), "AddLogicItem");
  if (why) notify("info", why);
  else startConnecting(id, conditionOf(branch), undefined, branch.id === "error");
}
