/** On which computer the selected object runs. A separate chunk. */

import { t } from "@lingui/core/macro";
import { notMovable, setNode } from "../../commands/nodes";
import { translate } from "../../i18n/serverMessages";
import { heldBy } from "../../store/selectors";
import { useEditor } from "../../store/store";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";
import { NodePick } from "./NodePick";

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]);
  const nodes = useEditor((state) => state.nodes);
  const holder = useEditor((state) => heldBy(state, id));
  const cannot = useEditor((state) => (object ? notMovable(state, object) : ""));
  const { refused, busy, ask } = useRefusal();
  if (!object || !nodes) return null;
  const why = holder ? t`In use by ${holder}.` : cannot;
  const chosen = nodes.assigned[object.name] ?? object.node ?? "";
  return (
    <>
      {why && <p className="quiet small">{why}</p>}
      <NodePick chosen={chosen} isDisabled={why !== "" || busy} onChange={(node) => void ask(setNode(id, node))} />
      {nodes.apart && <p className="small alarm">{translate(nodes.apart)}</p>}
      <RefusedText>{refused}</RefusedText>
    </>
  );
};

export default Body;
