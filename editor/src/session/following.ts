/** Asks for what belongs to the open document and comes by no event at first: breakpoints, view state, reachability. */

import type { State } from "../store/state";
import { now, store } from "../store/store";
import { call, serves } from "./session";

let followed = "";

export function forgetFollowed(): void {
  followed = "";
}

/** Called with each state: asks when another document is open than the one that was asked for. */
export function followDocument(state: State): void {
  if (state.connection.status !== "ready") return;
  const id = state.doc ? (state.doc.project?.id ?? state.doc.scene.id) : "-";
  if (id === followed) return;
  followed = id;
  const still = () => followed === id;
  void general(still);
  if (state.doc) void ofDocument(id, state.doc.project !== null, still);
}

async function general(still: () => boolean): Promise<void> {
  if (!serves("GetViewState")) return;
  const read = (scope: "user" | "shared") =>
    call("GetViewState", { scope }).then(
      ({ values }) => values,
      () => ({}),
    );
  const [shared, own] = await Promise.all([read("shared"), read("user")]);
  if (still()) store.setState((state) => ({ view: { ...state.view, general: { ...shared, ...own } } }));
}

async function ofDocument(document: string, project: boolean, still: () => boolean): Promise<void> {
  const ask = async (work: Promise<Partial<State>>) => {
    const change = await work.catch(() => null); // refused for want of a document that was closed meanwhile
    if (change && still()) store.setState(change);
  };
  if (serves("GetViewState")) {
    for (const scope of ["user", "shared"] as const) {
      void ask(
        call("GetViewState", { scope, document }).then(({ values }) => ({ view: { ...now().view, [scope]: values } })),
      );
    }
  }
  if (!project) return;
  if (serves("GetBreakpoints")) {
    void ask(
      // By its id: while its program runs it is not open.
      call("GetBreakpoints", { project_id: document }).then(({ ids }) => ({
        breakpoints: Object.fromEntries(ids.map((id) => [id, true as const])),
      })),
    );
  }
  if (serves("Reachability")) {
    void ask(
      call("Reachability").then((all) => ({
        reach: Object.fromEntries(
          all.map((one) => [[one.robot_id, one.arm_id ?? "", one.end_effector_id].join("/"), one]),
        ),
      })),
    );
  }
}
