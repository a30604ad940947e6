/** The position of the open function: Program › handle_board, with Back and the menu of the function. */

import { t } from "@lingui/core/macro";
import { Button as AriaButton } from "react-aria-components";
import { scopeOf } from "../../store/scope";
import { showFunction, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { FunctionMenu } from "./FunctionMenu";
import "./functions.css";

export default function ScopeBar() {
  const doc = useEditor((state) => state.doc);
  if (!doc) return null;
  const { path } = doc;
  const crumbs = [t`Program`, ...path.map((id) => doc.functions[id]?.name ?? "")];
  return (
    <nav className="scope-bar" aria-label={t`Open function`}>
      <Button variant="plain" icon="left" aria-label={t`Back`} onPress={() => showFunction(path.slice(0, -1))} />
      <ol>
        {crumbs.map((name, n) => (
          <li key={`${n}/${name}`}>
            {n === path.length ? (
              <strong aria-current="page">{name}</strong>
            ) : (
              <AriaButton className="crumb" onPress={() => showFunction(path.slice(0, n))}>
                {name}
              </AriaButton>
            )}
          </li>
        ))}
      </ol>
      <FunctionMenu id={scopeOf(doc)} />
    </nav>
  );
}
