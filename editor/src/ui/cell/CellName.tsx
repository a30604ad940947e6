/** The name of the cell that this device commands, and the way to the page with all cells. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { showWorkplaces } from "../../commands/workplaces";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";

/** Return the name of the cell; an empty string if it has none. It is also the title of the page. */
export function useCellName(): string {
  const name = useEditor((state) => state.connection.server?.cell?.name ?? "");
  useEffect(() => {
    if (name) document.title = name;
  }, [name]);
  return name;
}

/** The name in the bar of a screen. If there is a fleet, it opens the page with all cells. */
export function CellName() {
  const name = useCellName();
  const fleet = useEditor((state) => state.connection.server?.cell?.fleet);
  if (!name) return null;
  if (!fleet) return <strong className="cell-name">{name}</strong>;
  return (
    <Button
      variant="plain"
      icon="left"
      className="cell-name"
      aria-label={t`${name}: show all workplaces`}
      onPress={() => void showWorkplaces(fleet)}
    >
      <span>{name}</span>
    </Button>
  );
}
