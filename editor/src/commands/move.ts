/**
 * Move, turn and resize an item: shown at once, previewed to other users meanwhile, and sent to the server as one edit
 * at the end. The item is locked meanwhile.
 */

import type { ObjectModel, Pose } from "../protocol/types";
import { call, serves } from "../session/connection";
import { now, setUi, store } from "../store/store";
import { same } from "../transform/placing";
import type { Target } from "../transform/target";
import { relativeTo } from "../viewmodel/frames";
import { ask, holding } from "./requests";

/** Time between two previews, s. */
const PREVIEW = 1 / 30;
/** Time after which a series of steps ends, s. */
export const SETTLED = 0.6;

/** A change in progress. */
export class Moving {
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
  private told = 0;
  private telling: ReturnType<typeof setTimeout> | undefined;
  private settling: ReturnType<typeof setTimeout> | undefined;
  private held = false;

  constructor(readonly target: Target) {
    const decided = new Promise<boolean>((resolve) => (this.end = resolve));
    const work = async () => {
      this.held = true;
      if (!this.finishing) this.notify(); // otherwise the edit itself notifies the users
      return !(await decided) || (await this.store());
    };
    const before = latest;
    // Wait for the previous change, which would release the lock of this one.
    this.over = before
      .then(() => holding(target.id, work, target.kind === "point"))
      .then((done) => {
        this.ended = true;
        clearTimeout(this.telling);
        clearTimeout(this.settling);
        if (current === this) current = null;
        if (done) return;
        this.failed = true;
        this.forget();
      });
    latest = this.over;
  }

  /** Show the item at a pose in the world. */
  to(pose: Pose, model?: ObjectModel): void {
    if (this.failed || this.ended) return;
    const { target } = this;
    this.stored = relativeTo(target.frame, pose);
    if (model) this.model = model;
    const state = now();
    const type = this.model && target.type ? { model: this.model, type: state.types.byName[target.type] } : {};
    setUi({ draft: { id: target.id, of: known(state, target.id), pose: this.stored, ...type } });
    this.notify();
  }

  /** End the change and send the edit. */
  finish(): void {
    this.finishing = true;
    this.end(true);
  }

  /** Like `finish`, if nothing follows within a moment. */
  settle(): void {
    clearTimeout(this.settling);
    this.settling = setTimeout(() => this.finish(), SETTLED * 1000);
  }

  /** Restore the previous pose; nothing is sent. */
  cancel(): void {
    this.failed = this.finishing = true;
    this.forget();
    this.end(false);
  }

  private forget(): void {
    if (now().ui.draft?.id === this.target.id) setUi({ draft: undefined });
  }

  /** Send the current pose to the other users; older ones are dropped. */
  private notify(): void {
    if (!this.held || !this.stored || this.failed || this.telling !== undefined || !serves("PreviewMove")) return;
    const wait = Math.max(0, this.told + PREVIEW * 1000 - performance.now());
    this.telling = setTimeout(() => {
      this.telling = undefined;
      if (!this.stored || this.failed || this.ended) return;
      this.told = performance.now();
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
      if (!(await holding(type, () => ask("UpdateObjectModel", { object_type_id: type, object_model: model }))))
        return false;
    }
    if (!stored || same(stored, relativeTo(target.frame, target.pose))) {
      this.forget();
      return true;
    }
    return (await asked(target, stored)) !== undefined;
  }
}

function asked({ kind, id }: Target, { position, orientation }: Pose) {
  switch (kind) {
    case "object":
      return ask("UpdateObjectPose", { object_id: id, pose: { position, orientation } });
    case "point":
      return ask("UpdateActionPointPosition", { action_point_id: id, new_position: position });
    case "orientation":
      return ask("UpdateActionPointOrientation", { orientation_id: id, orientation });
  }
}

let current: Moving | null = null;
let latest: Promise<void> = Promise.resolve();

/** Start to move an item, or continue. A previous change of another item is finished. */
export function moving(target: Target): Moving {
  if (current && !current.finishing && !current.failed && current.target.id === target.id) return current;
  current?.finish();
  current = new Moving(target);
  return current;
}

/** Move the item to a pose in the world by one edit. */
export async function place(target: Target, pose: Pose, model?: ObjectModel): Promise<boolean> {
  const one = moving(target);
  one.to(pose, model);
  one.finish();
  await one.over;
  return !one.failed;
}

/** Make a step; several quick steps become one edit. */
export function step(target: Target, pose: Pose): void {
  const one = moving(target);
  one.to(pose);
  one.settle();
}

store.subscribe((state, before) => {
  // Selecting another item finishes the change.
  const { selection, draft } = state.ui;
  if (current && selection?.id !== before.ui.selection?.id && selection?.id !== current.target.id) current.finish();
  if (!draft || state.doc === before.doc) return;
  const thing = known(state, draft.id);
  if (thing === draft.of) return;
  // The event of the edit has arrived: end the preview, unless the next change has started.
  const goesOn = thing !== undefined && current?.target.id === draft.id && !current.finishing;
  setUi({ draft: goesOn ? { ...draft, of: thing } : undefined });
});

function known({ doc }: ReturnType<typeof now>, id: string): unknown {
  return doc?.objects[id] ?? doc?.points[id] ?? doc?.orientations[id];
}
