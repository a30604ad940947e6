/** Request the data of the open document that no event brings at first: breakpoints, view state, reachability. */

import { inUserLanguage } from "../i18n/serverMessages";
import type { State } from "../store/state";
import { getState, store } from "../store/store";
import { call, serves } from "./connection";
import type { Follower } from "./follower";

export class DocumentDetails implements Follower {
  /** Id of the document whose data was requested; "-" without a document. */
  private current = "";

  reset(): void {
    this.current = "";
  }

  follow(state: State): void {
    if (state.connection.status !== "ready") return;
    const id = state.doc ? (state.doc.project?.id ?? state.doc.scene.id) : "-";
    if (id === this.current) return;
    this.current = id;
    const isCurrent = () => this.current === id;
    if (state.doc) void loadDetails(id, state.doc.scene.id, state.doc.project !== null, isCurrent);
  }
}

async function loadDetails(document: string, scene: string, project: boolean, isCurrent: () => boolean): Promise<void> {
  const ask = async (work: Promise<Partial<State>>) => {
    const change = await work.catch(() => null); // refused if the document has been closed
    if (change && isCurrent()) store.setState(change);
  };
  if (serves("GetViewState")) {
    for (const [part, scope, of] of [
      ["user", "user", document],
      ["shared", "shared", document],
      ["scene", "shared", scene],
    ] as const) {
      void ask(
        call("GetViewState", { scope, document: of }).then(({ values }) => ({
          view: { ...getState().view, [part]: values },
        })),
      );
    }
  }
  if (!project) return;
  if (serves("GetBreakpoints")) {
    void ask(
      // By id, since the project is not open while its program runs.
      call("GetBreakpoints", { project_id: document }).then(({ ids }) => ({
        breakpoints: Object.fromEntries(ids.map((id) => [id, true as const])),
      })),
    );
  }
  if (serves("Reachability")) {
    void ask(
      call("Reachability").then((all) => ({
        reach: Object.fromEntries(
          all.map((one) => [
            [one.robot_id, one.arm_id ?? "", one.end_effector_id].join("/"),
            { ...one, items: one.items.map(inUserLanguage) },
          ]),
        ),
      })),
    );
  }
}
