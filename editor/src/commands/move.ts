/**
 * Move, turn and resize an item. It is locked and previewed to other users during the motion, and sent to the server
 * as one edit at the end.
 */

import type { ObjectModel, Pose } from "../protocol/types";
import { call, serves } from "../session/connection";
import { itemOf } from "../store/document";
import { getState, setUi, store } from "../store/store";
import { same } from "../transform/placing";
import type { Target } from "../transform/target";
import { relativeTo } from "../viewmodel/frames";
import { ask, withLockOrNotify } from "./requests";

/** Time between two previews, s. */
const PREVIEW = 1 / 30;
/** Time after which a series of steps ends, s. */
export const SETTLED = 0.6;

declare module "../store/runtime" {
  interface Runtime {
    /** The change in progress, until the server has accepted or refused it. */
    itemMove?: ItemMove | undefined;
  }
}

/** A change in progress. */
export class ItemMove {
  /** It was refused or cancelled. */
  failed = false;
  /** Resolves when the server has accepted or refused the edit. */
  readonly over: Promise<void>;
  private end: (keep: boolean) => void = () => {};
  /** No further changes are accepted. */
  finishing = false;
  private ended = false;
  private stored: Pose | null = null;
  private model: ObjectModel | null = null;
  private previewed = 0;
  private previewTimer: ReturnType<typeof setTimeout> | undefined;
  private settleTimer: ReturnType<typeof setTimeout> | undefined;
  private held = false;

  /** `before`: end of the previous change, which would release the lock of this one. */
  constructor(
    readonly target: Target,
    before: Promise<void> = Promise.resolve(),
  ) {
    const decided = new Promise<boolean>((resolve) => (this.end = resolve));
    const work = async () => {
      this.held = true;
      if (!this.finishing) this.preview(); // otherwise the edit itself notifies the users
      return !(await decided) || (await this.store());
    };
    const unsubscribe = store.subscribe(({ ui }, { ui: { selection } }) => {
      // Selecting another item finishes the change.
      if (ui.selection?.id !== selection?.id && ui.selection?.id !== target.id) this.finish();
    });
    this.over = before
      .then(() => withLockOrNotify(target.id, work, carriesPoints(target)))
      .then((done) => {
        this.ended = true;
        clearTimeout(this.previewTimer);
        clearTimeout(this.settleTimer);
        unsubscribe();
        const { runtime } = getState();
        if (runtime.itemMove === this) runtime.itemMove = undefined;
        if (done) return;
        this.failed = true;
        this.forget();
      });
  }

  /** Show the item at a pose in the world. */
  moveTo(pose: Pose, model?: ObjectModel): void {
    if (this.failed || this.ended) return;
    const { target } = this;
    this.stored = relativeTo(target.frame, pose);
    if (model) this.model = model;
    const state = getState();
    const type = this.model && target.type ? { model: this.model, type: state.types.byName[target.type] } : {};
    setUi({ draft: { id: target.id, of: itemOf(state.doc, target.id), pose: this.stored, continues: true, ...type } });
    this.preview();
  }

  /** End the change and send the edit. */
  finish(): void {
    if (this.finishing) return;
    this.finishing = true;
    clearTimeout(this.settleTimer);
    const { draft } = getState().ui;
    if (draft?.id === this.target.id) setUi({ draft: { ...draft, continues: false } });
    this.end(true);
  }

  /** Like `finish`, if nothing follows within a moment. */
  settle(): void {
    clearTimeout(this.settleTimer);
    this.settleTimer = setTimeout(() => this.finish(), SETTLED * 1000);
  }

  /** Restore the previous pose; nothing is sent. */
  cancel(): void {
    this.failed = this.finishing = true;
    this.forget();
    this.end(false);
  }

  private forget(): void {
    if (getState().ui.draft?.id === this.target.id) setUi({ draft: undefined });
  }

  /** Send the current pose to the other users; older ones are dropped. */
  private preview(): void {
    if (!this.held || !this.stored || this.failed || this.previewTimer !== undefined || !serves("PreviewMove")) return;
    const wait = Math.max(0, this.previewed + PREVIEW * 1000 - performance.now());
    this.previewTimer = setTimeout(() => {
      this.previewTimer = undefined;
      if (!this.stored || this.failed || this.ended) return;
      this.previewed = performance.now();
      const { kind, id } = this.target;
      const { position, orientation } = this.stored;
      const shown = { ...(kind === "orientation" ? {} : { position }), ...(kind === "point" ? {} : { orientation }) };
      call("PreviewMove", { id, ...shown }).catch(() => {}); // the next preview, or the edit, follows
    }, wait);
  }

  /** Send the edit. Return whether it was accepted. */
  private async store(): Promise<boolean> {
    const { target, stored, model } = this;
    if (model && target.type) {
      const { type } = target;
      if (!(await withLockOrNotify(type, () => ask("UpdateSceneShape", { object_type_id: type, object_model: model }))))
        return false;
    }
    if (!stored || same(stored, relativeTo(target.frame, target.pose))) {
      this.forget();
      return true;
    }
    return (await sendPose(target, stored)) !== undefined;
  }
}

/** Return whether action points move with it: they have to be locked, too. */
function carriesPoints({ kind, id }: Target): boolean {
  return kind === "point" || Object.values(getState().doc?.points ?? {}).some((each) => each.parent === id);
}

function sendPose({ kind, id }: Target, { position, orientation }: Pose) {
  switch (kind) {
    case "object":
      return ask("UpdateSceneObjectPose", { object_id: id, pose: { position, orientation } });
    case "point":
      return ask("UpdateActionPointPosition", { action_point_id: id, new_position: position });
    case "orientation":
      return ask("UpdateActionPointOrientation", { orientation_id: id, orientation });
  }
}

/** Start to move an item, or continue. A previous change of another item is finished. */
export function beginMove(target: Target): ItemMove {
  const { runtime } = getState();
  const running = runtime.itemMove;
  if (running && !running.finishing && !running.failed && running.target.id === target.id) return running;
  running?.finish();
  runtime.itemMove = new ItemMove(target, running?.over);
  return runtime.itemMove;
}

/** Move the item to a pose in the world by one edit. */
export async function place(target: Target, pose: Pose, model?: ObjectModel): Promise<boolean> {
  const one = beginMove(target);
  one.moveTo(pose, model);
  one.finish();
  await one.over;
  return !one.failed;
}

/** Make a step; several quick steps become one edit. */
export function step(target: Target, pose: Pose): void {
  const one = beginMove(target);
  one.moveTo(pose);
  one.settle();
}
