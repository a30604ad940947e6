/** Recipes with their release and changeover, and records of units; a separate chunk. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { ModalDialog } from "../kit/dialogs";
import { ToggleGroup } from "../kit/fields";
import { Recipes } from "./Recipes";
import { Units } from "./Units";
import "./production.css";

type Page = "recipes" | "units";

export default function Production({ onClose }: { onClose: () => void }) {
  const [page, setPage] = useState<Page>("recipes");
  return (
    <ModalDialog title={t`Recipes and units`} onClose={onClose}>
      <ToggleGroup
        label={t`Page`}
        quiet
        value={page}
        choices={[
          ["recipes", t`Recipes`],
          ["units", t`Units`],
        ]}
        onChange={setPage}
      />
      {page === "recipes" ? <Recipes onClose={onClose} /> : <Units onClose={onClose} />}
    </ModalDialog>
  );
}
