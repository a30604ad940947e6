/** A scene, project or package with its actions. */

import { plural, t } from "@lingui/core/macro";
import { useRef, useState } from "react";
import * as documents from "../../commands/documents";
import { downloadPackage } from "../../commands/packages";
import { runPackage } from "../../commands/run";
import { storeOwnPicture } from "../../commands/thumbnail";
import { storeGeneralState } from "../../commands/viewstate";
import { ago } from "../../formats";
import type { Entry } from "../../home/entries";
import type { Requests, Run } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { isRunning } from "../../store/selectors";
import { getState, notify, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { AskName, More } from "../kit/lazyControls";
import type { Choice } from "../kit/props";
import { endName } from "../run/History";
import { Deleting } from "./Deleting";
import { favoritesOf } from "./favorites";
import { Inline } from "./Inline";
import { Problems } from "./Problems";
import { isTemplate, storeOpened, storeTemplate } from "./recent";
import { Thumbnail } from "./Thumbnail";

type Command = "open" | "copy" | "rename" | "describe" | "remove";
const REQUESTS: Record<Entry["kind"], Partial<Record<Command, keyof Requests>>> = {
  scene: {
    open: "OpenScene",
    copy: "CopyScene",
    rename: "RenameScene",
    describe: "UpdateSceneDescription",
    remove: "DeleteScene",
  },
  project: {
    open: "OpenProject",
    copy: "CopyProject",
    rename: "RenameProject",
    describe: "UpdateProjectDescription",
    remove: "DeleteProject",
  },
  package: { open: "RunPackage", rename: "RenamePackage", remove: "DeletePackage" },
};

interface CardProps {
  entry: Entry;
  marked: boolean;
  /** Existing names of this kind. */
  taken: string[];
  /** Show the related entries. */
  onRelated: (kind: Entry["kind"], search: string) => void;
  /** Create a project for this scene. */
  onProject: (scene: string) => void;
}

export function Card({ entry, marked, taken, onRelated, onProject }: CardProps) {
  const { kind, id, name, problems } = entry;
  const [doing, setDoing] = useState<"" | "copy" | "rename" | "describe" | "remove">("");
  const connection = useEditor((state) => state.connection);
  const owner = useEditor((state) => state.locks[id]);
  const isFavorite = useEditor((state) => favoritesOf(state).has(id));
  const running = useEditor(isRunning);
  const why = (command: Command) => {
    const request = REQUESTS[kind][command];
    if (owner && owner !== connection.user && command !== "open" && command !== "copy") return t`In use by ${owner}.`;
    return request ? whyUnavailable({ ...getState(), connection }, request) : "";
  };
  const whyOpen = why("open") || (running ? t`Stop the program first.` : "");
  const whyThis = whyOpen || (problems.length > 0 ? t`Fix its problems first, then open it.` : "");
  const run = useEditor((state) =>
    kind === "package" ? state.program.runs.find((each) => each.package_id === id) : undefined,
  );
  const template = useEditor((state) => isTemplate(state, id));
  const own = useEditor((state) => state.thumbnails[id]?.own ?? false);
  const picture = useRef<HTMLInputElement>(null);
  const storePicture = (file: File | null) =>
    void storeOwnPicture(id, file).then((wrong) => wrong && notify("error", wrong));
  const open = (paused = false) => {
    if (kind === "package") storeOpened(id);
    void (kind === "scene"
      ? documents.openScene(id)
      : kind === "project"
        ? documents.openProject(id)
        : runPackage(id, paused));
  };
  const star = () => {
    const others = [...favoritesOf(getState())].filter((each) => each !== id);
    storeGeneralState({ stars: isFavorite ? others : [...others, id] });
  };
  const close = () => setDoing("");
  const choices: Choice[] = [
    ...(kind === "scene"
      ? [
          {
            id: "project",
            label: t`New project…`,
            why: whyUnavailable({ ...getState(), connection }, "NewProject"),
            act: () => onProject(id),
          },
        ]
      : []),
    ...(kind === "package" ? [{ id: "paused", label: t`Start paused`, why: whyOpen, act: () => open(true) }] : []),
    ...(kind === "package"
      ? [
          {
            id: "download",
            label: t`Download`,
            act: () => void downloadPackage(id, name).then((wrong) => wrong && notify("error", wrong)),
          },
        ]
      : [
          { id: "copy", label: t`Duplicate…`, why: why("copy"), act: () => setDoing("copy") },
          { id: "describe", label: t`Describe…`, why: why("describe"), act: () => setDoing("describe") },
          {
            id: "picture",
            label: t`Choose picture…`,
            why: why("describe"),
            act: () => picture.current?.click(),
          },
          ...(own
            ? [
                {
                  id: "view",
                  label: t`Use the 3D view as picture`,
                  why: why("describe"),
                  act: () => storePicture(null),
                },
              ]
            : []),
          {
            id: "template",
            label: template ? t`Remove from templates` : t`Use as a template`,
            why: why("describe"),
            act: () => storeTemplate(id, !template),
          },
        ]),
    { id: "rename", label: t`Rename…`, why: why("rename"), act: () => setDoing("rename") },
    { id: "remove", label: t`Delete…`, why: why("remove"), act: () => setDoing("remove") },
  ];
  return (
    <li className="card" data-marked={marked} data-id={id}>
      {kind !== "package" && <Thumbnail id={id} time={entry.time} />}
      {kind !== "package" && (
        <input
          ref={picture}
          type="file"
          accept="image/*"
          className="hidden-but-read"
          tabIndex={-1}
          aria-hidden="true"
          aria-label={t`Picture of ${name}`}
          onChange={(event) => {
            const file = event.target.files?.[0];
            if (file) storePicture(file);
            event.target.value = "";
          }}
        />
      )}
      <div className="card-text">
        <div className="card-name">
          {doing === "rename" ? (
            <Inline
              label={t`New name of ${name}`}
              value={name}
              taken={taken}
              onSave={(to) => documents.rename(kind, id, to)}
              onClose={close}
            />
          ) : (
            <h2>{name}</h2>
          )}
          <Button
            variant="plain"
            className="star"
            aria-pressed={isFavorite}
            aria-label={isFavorite ? t`Remove ${name} from favorites` : t`Add ${name} to favorites`}
            onPress={star}
          >
            <span aria-hidden="true">{isFavorite ? "★" : "☆"}</span>
          </Button>
        </div>
        <p className="quiet small">
          {detail(entry, run)}
          {entry.time && ` · ${kind === "package" ? t`built ${ago(entry.time)}` : t`changed ${ago(entry.time)}`}`}
        </p>
        {template && (
          <p>
            <span className="tag">{t`template`}</span>
          </p>
        )}
        {owner && owner !== connection.user && (
          <p className="tag warn">
            <Icon name="lock" size={16} /> {t`In use by ${owner}`}
          </p>
        )}
        {doing === "describe" && kind !== "package" ? (
          <Inline
            label={t`Description of ${name}`}
            value={entry.description}
            many
            onSave={(to) => documents.describe(kind, id, to)}
            onClose={close}
          />
        ) : (
          entry.description && <p className="small description">{entry.description}</p>
        )}
        {problems.length > 0 && (
          <Problems entry={entry} whyOpen={whyOpen} onScene={() => onRelated("scene", entry.from?.name ?? "")} />
        )}
      </div>
      <div className="card-actions">
        <Button
          variant="primary"
          icon={kind === "package" ? "play" : undefined}
          why={whyThis}
          onPress={() => open()}
          aria-label={kind === "package" ? t`Run ${name}` : t`Open ${name}`}
        >
          {kind === "package" ? t`Run` : t`Open`}
        </Button>
        <Related entry={entry} onRelated={onRelated} />
        <More label={t`More about ${name}`} choices={choices} />
      </div>
      {doing === "copy" && (
        <AskName
          title={t`Duplicate ${name}`}
          initial={t`${name} copy`}
          taken={taken}
          confirmLabel={t`Duplicate`}
          onClose={close}
          onConfirm={(to) =>
            void (kind === "scene" ? documents.duplicateScene(id, to) : documents.duplicateProject(id, to))
          }
        />
      )}
      {doing === "remove" && <Deleting entry={entry} onClose={close} />}
    </li>
  );
}

function detail({ kind, from, projects, executed }: Entry, run: Run | undefined): string {
  if (kind === "scene") return plural(projects ?? 0, { one: "# project", other: "# projects" });
  if (kind === "project") return from ? t`on ${from.name}` : t`on a deleted scene`;
  const last = run ? `${ago(run.started)}: ${endName(run.end)}` : executed ? ago(executed) : "";
  return [from && t`from ${from.name}`, last ? t`last run ${last}` : t`not run yet`].filter(Boolean).join(" · ");
}

/** Show its scene, project or projects. */
function Related({
  entry: { kind, name, from, projects },
  onRelated,
}: {
  entry: Entry;
  onRelated: CardProps["onRelated"];
}) {
  if (kind === "scene") {
    return projects ? (
      <Button variant="plain" aria-label={t`Projects on ${name}`} onPress={() => onRelated("project", name)}>
        {t`Projects`}
      </Button>
    ) : null;
  }
  if (!from || from.gone) return null;
  const to = kind === "project" ? ("scene" as const) : ("project" as const);
  return (
    <Button
      variant="plain"
      aria-label={to === "scene" ? t`Scene of ${name}` : t`Project of ${name}`}
      onPress={() => onRelated(to, from.name)}
    >
      {to === "scene" ? t`Scene` : t`Project`}
    </Button>
  );
}
