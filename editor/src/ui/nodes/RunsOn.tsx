/** On which computer the selected object runs. A separate chunk. */

import { t } from "@lingui/core/macro";
import { notMovable, objectsByNode, setNode } from "../../commands/nodes";
import { translate } from "../../i18n/serverMessages";
import { heldBy } from "../../store/selectors";
import { useEditor } from "../../store/store";
import { Pick } from "../kit/fields";
import { RefusedText, useRefusal } from "../points/Refusal";
import type { Section } from "../workplace/section";

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]);
  const objects = useEditor((state) => state.doc?.objects);
  const nodes = useEditor((state) => state.nodes);
  const holder = useEditor((state) => heldBy(state, id));
  const cannot = useEditor((state) => (object ? notMovable(state, object) : ""));
  const { refused, busy, ask } = useRefusal();
  if (!object || !nodes) return null;
  const why = holder ? t`In use by ${holder}.` : cannot;
  const byNode = objectsByNode(nodes, Object.values(objects ?? {}));
  const chosen = nodes.assigned[object.name] ?? object.node ?? "";
  const others = Object.keys(byNode);
  const names = [...new Set([...nodes.nodes.map(({ name }) => name), ...others])].sort();
  const silent = nodes.nodes.find(({ name }) => name === chosen)?.state === "silent";
  return (
    <>
      {why && <p className="quiet small">{why}</p>}
      <Pick
        label={t`Runs on`}
        value={chosen}
        isDisabled={why !== "" || busy}
        choices={[["", t`computer of the server`], ...names.map((each) => [each, each] as const)]}
        onChange={(node) => void ask(setNode(id, node))}
      />
      {silent && <p className="small alarm">{t`The node ${chosen} is not connected.`}</p>}
      {nodes.apart && <p className="small alarm">{translate(nodes.apart)}</p>}
      <RefusedText>{refused}</RefusedText>
    </>
  );
};

export default Body;
