/** An action in the graph with its free branches: tap one, then the next action; or drag. */

import { t } from "@lingui/core/macro";
import { Handle, type Node, type NodeProps, Position } from "@xyflow/react";
import { notEditable, startConnecting } from "../../commands/program";
import { notify, now } from "../../store/store";
import { Icon } from "../kit/icons";
import { ReachBadge } from "../points/Reach";
import { type Box, lastIn, type Way } from "./graph";

export type FlowNodeType = Node<
  { box: Box; running: boolean; breakpoint: boolean; paused: boolean; trouble: string; target: boolean; from: boolean },
  "box"
>;

export function FlowNode({ data }: NodeProps<FlowNodeType>) {
  const { box, running, paused, breakpoint, trouble, target, from } = data;
  return (
    <div className={`flow-node ${box.kind}`} data-running={running} data-target={target} data-from={from}>
      {box.kind !== "start" && (
        <Handle type="target" position={Position.Top} className="flow-into" isConnectableStart={false} aria-hidden />
      )}
      <div className="flow-name">
        {box.kind === "fold" && <Icon name="list" size={18} />}
        {breakpoint && <span className="breakpoint-dot" data-on="true" role="img" aria-label={t`pauses here`} />}
        {box.name}
        {box.kind === "action" && <ReachBadge id={box.id} />}
        {running && <span className="tag good">{paused ? "next" : "runs"}</span>}
        {trouble && (
          <span className="flow-trouble" role="img" aria-label={trouble} title={trouble}>
            <Icon name="warn" size={16} />
          </span>
        )}
      </div>
      {box.detail && <div className="quiet small flow-detail">{box.detail}</div>}
      <div className="flow-ways">
        {box.ways.map((way) => (
          <Handle
            key={way.id}
            id={way.id}
            type="source"
            position={Position.Bottom}
            className={`flow-way ${way.id}`}
            role="button"
            tabIndex={0}
            aria-label={`${box.name}: ${way.label}`}
            onClick={(event) => {
              event.stopPropagation();
              begin(lastIn(box), way);
            }}
            onKeyDown={(event) => {
              if (event.key !== "Enter" && event.key !== " ") return;
              event.stopPropagation();
              begin(lastIn(box), way);
            }}
          >
            {way.label}
          </Handle>
        ))}
        {box.ways.length === 0 && box.kind !== "end" && (
          <Handle type="source" position={Position.Bottom} className="flow-none" isConnectable={false} aria-hidden />
        )}
      </div>
    </div>
  );
}

export function conditionOf(way: Way) {
  return way.what && (way.id === "true" || way.id === "false") ? { what: way.what, value: way.id } : undefined;
}

function begin(id: string, way: Way): void {
  const why = notEditable(now(), "AddLogicItem");
  if (why) notify("info", why);
  else startConnecting(id, conditionOf(branch));
}
