/** Choose the computer on which an object runs. */

import { t } from "@lingui/core/macro";
import { objectsByNode } from "../../commands/nodes";
import { useEditor } from "../../store/store";
import { SelectField } from "../kit/fields";

interface NodePickProps {
  /** Name of the node; empty for the computer of the server. */
  chosen: string;
  isDisabled: boolean;
  onChange: (node: string) => void;
}

export function NodePick({ chosen, isDisabled, onChange }: NodePickProps) {
  const nodes = useEditor((state) => state.nodes);
  const objects = useEditor((state) => state.doc?.objects);
  const listed = nodes?.nodes ?? [];
  const named = Object.keys(objectsByNode(nodes, Object.values(objects ?? {})));
  const names = [...new Set([...listed.map(({ name }) => name), ...named])].sort();
  const silent = listed.find(({ name }) => name === chosen)?.state === "silent";
  return (
    <>
      <SelectField
        label={t`Runs on`}
        value={chosen}
        isDisabled={isDisabled}
        choices={[["", t`computer of the server`], ...names.map((each) => [each, each] as const)]}
        onChange={onChange}
      />
      {silent && <p className="small alarm">{t`The node ${chosen} is not connected.`}</p>}
    </>
  );
}
