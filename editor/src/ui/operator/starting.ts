/** The reasons known to this page why the server would refuse to start or resume a program. Pure functions. */

import { t } from "@lingui/core/macro";
import type { CellStatus } from "../../protocol/types";
import { ROLES } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import type { State } from "../../store/state";

/** Return why users cannot start programs on this cell now; an empty string if they can. */
export function whyNoStart(state: State, cell: CellStatus | null | undefined): string {
  const unavailable = whyUnavailable(state, "RunPackage");
  if (unavailable) return unavailable;
  const [force] = state.forces;
  if (force) {
    const output = `${force.object}: ${force.point}`;
    return t`${output} is forced. End the force first.`;
  }
  if (cell?.authority === "plc") return t`Only the PLC starts programs. A technician can change this.`;
  if (cell?.authority === "nobody")
    return t`No program starts until a technician gives the authority to this server or the PLC.`;
  if (cell?.mode === "manual") return t`No program starts in the mode manual.`;
  if (cell?.mode === "maintenance" && state.connection.role < ROLES.technician)
    return t`Only technicians start programs in the mode maintenance.`;
  return "";
}

/** Return why the paused program cannot be resumed here; an empty string if it can. */
export const whyNoResume = (cell: CellStatus | null | undefined): string =>
  cell?.held_by_plc ? t`The PLC holds the program and resumes it.` : "";
