/** Switch this device from this cell to another one. */

import { theSession } from "../session/session";
import { getState } from "../store/store";
import { ask } from "./requests";

/** Release the locks and motions of this device, and show the page with all cells. */
export async function showWorkplaces(address: string): Promise<void> {
  if (getState().connection.shared) await ask("LogOff");
  await theSession().releaseLocksAndLeave();
  location.assign(address);
}
