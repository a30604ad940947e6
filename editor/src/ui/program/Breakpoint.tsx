/** The breakpoint of a point: the program pauses before every action that uses its pose or joints. */

import { t } from "@lingui/core/macro";
import { breakAt } from "../../commands/run";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import "./program.css";

const Breakpoint: Section["Body"] = ({ selection: { id } }) => {
  const on = useEditor((state) => id in state.breakpoints);
  const why = useEditor((state) => whyUnavailable(state, "SetBreakpoints"));
  return (
    <Button aria-pressed={on} why={why} onPress={() => void breakAt(id, !on)}>
      <span className="breakpoint-dot" data-on={on} aria-hidden="true" /> {t`Pause when a robot moves here`}
    </Button>
  );
};
export default Breakpoint;
