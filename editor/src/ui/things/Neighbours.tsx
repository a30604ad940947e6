/** Buttons to the previous and next item of the object list, as filtered. */

import { t } from "@lingui/core/macro";
import { useMemo } from "react";
import { select, useEditor } from "../../store/store";
import { allOf, fitting, neighbour, thingsOf } from "../../viewmodel/things";
import { groupsOf } from "../../viewmodel/visibility";
import { Button } from "../kit/kit";

export default function Neighbours({ id }: { id: string }) {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const groups = useEditor((state) => groupsOf(state).join());
  const rows = useMemo(() => {
    const fits = fitting(new Set(groups.split(",").filter(Boolean)), "");
    const all = allOf(thingsOf({ doc, types })).filter((row) => fits(row) || row.id === id);
    return { before: neighbour(all, id, -1), after: neighbour(all, id, 1) };
  }, [doc, types, groups, id]);
  const to = (row: typeof rows.before) => row && select({ kind: row.kind, id: row.id });
  const alone = t`The list has no other objects.`;
  return (
    <span className="neighbours">
      <Button
        variant="plain"
        icon="left"
        aria-label={t`Previous: ${rows.before?.name ?? ""}`}
        why={rows.before ? "" : alone}
        onPress={() => to(rows.before)}
      />
      <Button
        variant="plain"
        icon="right"
        aria-label={t`Next: ${rows.after?.name ?? ""}`}
        why={rows.after ? "" : alone}
        onPress={() => to(rows.after)}
      />
    </span>
  );
}
