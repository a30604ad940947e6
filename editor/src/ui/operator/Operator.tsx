/**
 * The operator's screen, at `/#/operator`: state of the machine, Start and Stop, alarms and failures. It needs the
 * operator role only. `/#/operator?kiosk` has no link to the editor.
 */

import { t } from "@lingui/core/macro";
import { type ComponentType, Suspense, useEffect, useRef, useState } from "react";
import { shownRecipe } from "../../commands/production";
import * as commands from "../../commands/run";
import { storeGeneralState } from "../../commands/viewstate";
import { ago } from "../../formats";
import { shownMessage, splitAddress } from "../../program/messages";
import { dismissal, lastRun, type Result, resultOf, undismissedRun } from "../../program/results";
import { type AlarmRecord, ROLES } from "../../protocol/types";
import { serves } from "../../session/connection";
import { theSession } from "../../session/session";
import { usersOfDocument } from "../../store/absentUsers";
import { isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import { useEditor } from "../../store/store";
import { withNames } from "../../viewmodel/names";
import { AlarmCard } from "../alarms/AlarmCard";
import { useAlarms } from "../alarms/useAlarms";
import { CellName } from "../cell/CellName";
import { noteText } from "../cell/texts";
import { useCell } from "../cell/useCell";
import { openPoints } from "../io/address";
import { Icon, type IconName } from "../kit/icons";
import { Button, Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { Notices } from "../notices/Notices";
import PartsCard, { useInventories } from "../parts/PartsCard";
import { People } from "../people/People";
import type { ChosenProduct } from "../production/Product";
import { endName, History } from "../run/History";
import { ICONS } from "../run/Result";
import { Held, phaseName, RunButtons } from "../run/RunBar";
import { openOverlay } from "../search/overlay";
import { Settings } from "../settings/Settings";
import { useTicking } from "../times";
import { CurrentStep } from "./CurrentStep";
import { Production } from "./Production";
import { whyNoResume, whyNoStart } from "./starting";
import "../run/run.css";
import "./operator.css";

const Product = lazyComponent(() => import("../production/Product"));
const AlarmList = lazyComponent(() => import("../alarms/AlarmList"));

const TONES: Record<Result["tone"], string> = { good: "done", bad: "broken", warn: "interrupted", "": "idle" };

interface Shown {
  tone: string;
  word: string | undefined;
  icon: IconName;
}

/**
 * Return what the state area shows. A result takes precedence over "Ready" until it is dismissed. `refused`: whether
 * the server would refuse to start a program.
 */
function shownState(state: State, starting: boolean, result: Result | null, refused: boolean): Shown {
  const { state: phase } = state.program;
  if (starting) return { tone: "idle", word: t`Starting…`, icon: "play" };
  if (isRunning(state))
    return phase === "paused"
      ? { tone: "paused", word: phaseName(state.program), icon: "pause" }
      : { tone: "running", word: phaseName(state.program), icon: "play" };
  if (result) return { tone: TONES[result.tone], word: result.title, icon: ICONS[result.tone] };
  if (state.live.state === "started" && usersOfDocument(state).length > 0)
    return { tone: "idle", word: t`Devices are in use by the editor`, icon: "plug" };
  if (state.lists.packages?.length === 0) return { tone: "idle", word: t`No program yet`, icon: "info" };
  if (refused) return { tone: "idle", word: t`Not ready`, icon: "info" };
  return { tone: "idle", word: t`Ready`, icon: "check" };
}

/** `Cell` is the picture of the cell. */
export default function Operator({ kiosk, Cell }: { kiosk: boolean; Cell: ComponentType }) {
  const state = useEditor((each) => each);
  const { program, lists, doc } = state;
  const runs = isRunning(state);
  const packages = [...(lists.packages ?? [])].sort((a, b) => b.package_meta.built.localeCompare(a.package_meta.built));
  const [chosen, setChosen] = useState("");
  /** The product to start, null if none was chosen, undefined until it is loaded. */
  const [product, setProduct] = useState<ChosenProduct | null | undefined>(serves("ListRecipes") ? undefined : null);
  const [releasedOnly, setReleasedOnly] = useState(false);
  const [starting, setStarting] = useState(false);
  const [listing, setListing] = useState(false);
  const listed = useAlarms("retained");
  const inventories = useInventories();
  const cell = useCell();
  const note = cell && noteText(cell);
  const alarms = listed ?? [];
  // The cards are shown together with the content below them, so that buttons do not move after loading.
  const loaded =
    (listed || !serves("ListAlarms")) &&
    (inventories || !serves("GetParts")) &&
    (cell !== undefined || !serves("GetCell"));
  // Until a package is chosen, Start produces the product.
  const made = product && !packages.some((each) => each.id === chosen) ? product : null;
  const before = useRef("");
  // A package that is built later does not replace the selected one.
  const known = [made?.recipe.package_id ?? chosen, program.packageId, before.current, packages[0]?.id]
    .map((id) => packages.find((each) => each.id === id))
    .find((each) => each !== undefined);
  before.current = known?.id ?? "";
  const onlyReleased = releasedOnly && state.connection.role === ROLES.operator;
  const shownPackages = onlyReleased ? [] : packages;
  const idle = !runs && !starting;
  const run = idle ? undismissedRun(state) : null;
  const result = resultOf(run ?? undefined);
  // The card of an alarm contains more information than the error of the run.
  const explained = alarms.some((each) => !each.acknowledged && each.run === run?.number);
  // The card about the parts shows that the run was interrupted.
  const asked = result?.tone === "warn" && inventories?.some((each) => each.run);
  useTicking();
  // The shown screen is not part of the state, so the session does not notice the change by itself.
  useEffect(() => {
    theSession().reportPresence();
    return () => theSession().reportPresence();
  }, []);
  const opened = doc && !runs ? (doc.project?.name ?? doc.scene.name) : "";
  const users = usersOfDocument(state);
  const refused = whyNoStart(state, cell);
  const { tone, word, icon } = shownState(state, starting, result, refused !== "");
  const why =
    onlyReleased && !made
      ? t`Choose a product first.`
      : !known
        ? t`No packages yet. Build one in the editor.`
        : opened && users.length > 0
          ? t`${opened} is open in the editor (${users.join(", ")}). Ask them to close it.`
          : inventories?.some((each) => each.run?.package_id === known.id && !each.run.confirmed)
            ? t`First confirm where the parts are.`
            : refused || (made?.problem ?? "");
  const start = async () => {
    if (!known) return;
    setStarting(true);
    await commands.runPackage(
      known.id,
      false,
      false,
      made ? { recipe_id: made.recipe.id, recipe_values: made.values, ...(made.order && { order: made.order }) } : {},
    );
    setStarting(false);
  };
  const message = runs ? shownMessage(state) : "";
  return (
    <div className="operator" data-tone={tone} data-alarm={alarms.some((each) => !each.acknowledged)}>
      <header className="bar">
        {!kiosk && (
          <Button variant="plain" icon="home" aria-label={t`Open the editor`} onPress={() => (location.hash = "")} />
        )}
        <CellName />
        <h1 data-name={runs || undefined}>{runs ? program.packageName || t`Program` : t`Operator`}</h1>
        {serves("ListAlarms") && (
          <Button
            variant="plain"
            icon="list"
            aria-label={t`All alarms`}
            aria-pressed={listing}
            onPress={() => setListing(!listing)}
          />
        )}
        <People />
        <Settings />
      </header>
      {listing && (
        <aside className="alarm-panel" aria-label={t`All alarms`}>
          <Suspense fallback={null}>
            <AlarmList />
          </Suspense>
        </aside>
      )}
      {/* Above all content that appears and disappears, so that these buttons do not move. */}
      <div className="operator-buttons">
        {runs ? (
          <RunButtons whyNoResume={whyNoResume(cell)} />
        ) : (
          <>
            <Button
              variant="primary"
              icon="play"
              why={why}
              isDisabled={starting || product === undefined}
              onPress={() => void start()}
            >
              {t`Start`}
            </Button>
            <div>
              {known && <p data-name>{made ? shownRecipe(made.recipe) : known.package_meta.name}</p>}
              {known && why && <p className="operator-why">{why}</p>}
            </div>
          </>
        )}
      </div>
      {!loaded && !listing && <Waiting>{t`Loading…`}</Waiting>}
      <main
        data-runs={runs}
        data-held={program.held !== null}
        hidden={listing || !loaded}
        // It scrolls, and may contain no other element that is reachable by keyboard.
        tabIndex={runs ? 0 : undefined}
      >
        {!program.held && !asked && (
          <section className="operator-state" aria-label={t`State`} role="status">
            <Icon name={icon} size={56} />
            <div>
              <p className="operator-word">{word}</p>
              {runs && <CurrentStep whyNoResume={whyNoResume(cell)} />}
              {message && <p className="operator-message">{message}</p>}
              {run && result && (
                <p>
                  {result.name}, {ago(run.ended ?? run.started)}
                </p>
              )}
              {result?.detail && !explained && <Reason>{withNames(state, result.detail)}</Reason>}
              {result?.tone === "bad" && !explained && (
                <p className="operator-advice">
                  {t`Fix the cause, then press Start. If it fails again, call for help.`}
                </p>
              )}
              {idle && !run && <LastRun />}
              {idle && !result && !why && !made && (
                <p className="operator-advice">{t`Choose a package, then press Start.`}</p>
              )}
            </div>
            {run && (
              <Button key={run.number} className="operator-dismiss" onPress={() => storeGeneralState(dismissal(run))}>
                {t`Dismiss`}
              </Button>
            )}
          </section>
        )}
        <Held />
        {!program.held && <PartsCard whyNoStart={refused} />}
        {!program.held && <Alarms alarms={alarms} />}
        {note && (
          <Button variant="plain" icon="info" className="operator-note wraps" onPress={() => openOverlay("cell")}>
            {note}
          </Button>
        )}
        {runs && doc && <Cell />}
        {!runs && (
          <section className="operator-start" aria-label={t`Start`}>
            <div className="operator-packages" role="radiogroup" aria-label={t`Packages`}>
              {serves("ListRecipes") && (
                <Suspense fallback={null}>
                  <Product
                    selected={made !== null}
                    onSelect={() => setChosen("")}
                    onFound={(found, only) => {
                      setProduct(found);
                      setReleasedOnly(only);
                    }}
                  />
                </Suspense>
              )}
              {shownPackages.map((each) => (
                <label key={each.id} className="operator-package" data-selected={!made && each.id === known?.id}>
                  <input
                    type="radio"
                    className="hidden-but-read"
                    name="package"
                    checked={!made && each.id === known?.id}
                    onChange={() => setChosen(each.id)}
                  />
                  <strong>{each.package_meta.name}</strong>
                  <span className="quiet small">{each.project_meta ? t`from ${each.project_meta.name}` : ""}</span>
                </label>
              ))}
              {packages.length === 0 && (
                <p className="quiet">{t`No packages yet. Build one in the editor, under Run.`}</p>
              )}
            </div>
            {opened && known && users.length === 0 && (
              <p className="quiet">
                {t`${opened} is open in the editor. It is closed during the run and keeps unsaved changes.`}
              </p>
            )}
          </section>
        )}
        <Production />
        <History />
        {!runs && doc && serves("StreamPoints") && <Button onPress={openPoints}>{t`Inputs and outputs`}</Button>}
      </main>
      <Notices />
    </div>
  );
}

/** A message of a device. Its address, which only a technician needs, is shown on request. */
function Reason({ children }: { children: string }) {
  const { text, address } = splitAddress(children);
  return (
    <div>
      {text}
      {address && (
        <details className="operator-more">
          <summary>{t`Details`}</summary>
          <p data-name>{address}</p>
        </details>
      )}
    </div>
  );
}

/** Report in one line how the last run ended. */
function LastRun() {
  const run = useEditor((state) => lastRun(state));
  if (!run) return null;
  return <p className="operator-advice">{t`Last run ${ago(run.ended ?? run.started)}: ${endName(run.end)}`}</p>;
}

/** Show the alarm to look at first, and the devices that are not connected and have no alarm. */
function Alarms({ alarms }: { alarms: readonly AlarmRecord[] }) {
  return (
    <>
      <AlarmCard alarms={alarms} />
      <Devices known={new Set(alarms.map((each) => each.object_id))} />
    </>
  );
}

/** List the devices that are not connected, without `known` devices. Nothing is shown for an empty list. */
function Devices({ known }: { known: ReadonlySet<string | undefined> }) {
  const live = useEditor((state) => state.live);
  const doc = useEditor((state) => state.doc);
  const wrong = Object.values(live.objects).filter(
    (each) =>
      !known.has(each.object_id) && (each.state === "lost" || each.state === "failed" || each.answering === false),
  );
  if (!doc || wrong.length === 0) return null;
  return (
    <section className="exception" role="alert">
      {wrong.map((each) => (
        <div key={each.object_id}>
          <Icon name="plug" />{" "}
          <strong>{t`${doc.objects[each.object_id]?.name ?? t`A device`} does not answer.`}</strong>
          {each.reason && <Reason>{each.reason}</Reason>}
        </div>
      ))}
    </section>
  );
}
