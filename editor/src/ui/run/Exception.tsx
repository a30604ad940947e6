/** What ended the last run, until the next one begins; a tap leads to the action in which it was. */

import { theEngine } from "../../session/engine";
import { now, select, setUi, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { nameOf, selectionOf, withNames } from "../names";

export function Exception() {
  const exception = useEditor((state) => state.program.exception);
  const name = useEditor((state) => nameOf(state, exception?.action_id ?? ""));
  if (!exception) return null;
  const id = exception.action_id;
  const show = () => {
    if (!id) return;
    setUi({ tool: "" });
    select(selectionOf(now(), id));
    theEngine()?.focus(id);
  };
  return (
    <div className="exception" role="alert">
      <p>
        <Icon name="warn" /> <strong>{name ? `It failed in ${name}` : "It failed"}</strong>
      </p>
      <p>{withNames(now(), exception.message)}</p>
      {name && (
        <Button icon="zoom" onPress={show}>
          Show {name}
        </Button>
      )}
    </div>
  );
}
