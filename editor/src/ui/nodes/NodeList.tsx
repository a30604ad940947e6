/** The nodes: which can be used, what runs on them, and what to do if one is missing. A separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { ago, clock, decimal } from "../../formats";
import { translate } from "../../i18n/serverMessages";
import type { NodeState, NodeStatus } from "../../protocol/types";
import { useEditor } from "../../store/store";
import { useTicking } from "../times";
import "./nodes.css";

const STATES: Record<NodeState, MessageDescriptor> = {
  connected: msg`connected`,
  silent: msg`not connected`,
  other_version: msg`other version`,
};
const GIGABYTE = 1e9;

export default function NodeList() {
  const nodes = useEditor((state) => state.nodes);
  useTicking();
  if (!nodes) return null;
  const problem = nodes.problem !== undefined && translate({ ...nodes, text: nodes.problem });
  return (
    <section className="nodes" aria-label={t`Nodes`}>
      <h3>{t`Nodes`}</h3>
      {problem && <p className="small alarm">{problem}</p>}
      {nodes.nodes.length === 0 && (
        <p className="quiet small">
          {t`No other computer is connected.`} <StartCommand name="NAME" />
        </p>
      )}
      <ul className="devices">
        {nodes.nodes.map((each) => (
          <li key={each.name}>
            <Node node={each} />
          </li>
        ))}
      </ul>
    </section>
  );
}

function Node({ node }: { node: NodeStatus }) {
  const { name, state, version, objects, error } = node;
  const packages = useEditor((each) => each.lists.packages);
  const tone = state === "connected" ? "good" : objects.length > 0 || state === "other_version" ? "bad" : "";
  return (
    <>
      <div className="device-head">
        <strong>{name}</strong>
        <span className={`tag ${tone}`}>{i18n._(STATES[state])}</span>
      </div>
      {state === "silent" && (
        <p className="small">
          {node.seen ? t`Last signal ${ago(node.seen)}.` : t`No signal since the server was started.`}{" "}
          {t`Switch the computer on and check its network cable.`} <StartCommand name={name} />
        </p>
      )}
      {state === "other_version" && (
        <p className="small">{t`It has version ${version}. Install the version of the server on it.`}</p>
      )}
      {state === "connected" &&
        node.sessions.map((each) => {
          const title = packages?.find(({ id }) => id === each.name)?.package_meta.name ?? each.name;
          const since = clock(each.since);
          return (
            <p key={each.since + each.name} className="small">
              {each.kind === "program"
                ? t`Runs the program ${title} since ${since}.`
                : each.kind === "scene"
                  ? t`Runs the scene ${title} since ${since}.`
                  : t`A scene or program starts.`}
            </p>
          );
        })}
      {state === "connected" && node.sessions.length === 0 && <p className="small">{t`Nothing runs here.`}</p>}
      {objects.length > 0 && <p className="small">{t`Devices of this scene: ${objects.join(", ")}`}</p>}
      {state === "connected" && <Health node={node} />}
      {error && <p className="quiet small">{t`Last error, ${ago(error.at)}: ${translate(error)}`}</p>}
    </>
  );
}

/** How to start a node on its computer: with the service of systemd, or by hand. */
const StartCommand = ({ name }: { name: string }) => (
  <>
    {t`Then start the node there:`} <code>systemctl restart arcor2-hw-node@{name}</code> {t`Without the service:`}{" "}
    <code>arcor2-hw node run {name}</code>
  </>
);

/** Computer, load and disk of a connected node. */
function Health({ node: { computer, since, load = 0, free = 0 } }: { node: NodeStatus }) {
  const percent = decimal(100 * load, 0);
  const space = decimal(free / GIGABYTE, 1);
  return (
    <p className="quiet small">
      {t`Computer ${computer}, started ${ago(since ?? "")}. Load ${percent} %, ${space} GB free.`}
    </p>
  );
}
