/**
 * The page with all cells, those that need attention first, and with their stored units and alarms. A tap on a card
 * opens the operator's screen of the cell.
 */

import { i18n } from "@lingui/core";
import { msg, plural, t } from "@lingui/core/macro";
import { Suspense, useMemo, useState, useSyncExternalStore } from "react";
import { compareTexts } from "../formats";
import { isLanguage, LANGUAGES, loadCatalogue, useLanguage } from "../i18n/catalogue";
import { remember } from "../session/localStorage";
import { Icon } from "../ui/kit/icons";
import { Button, Waiting } from "../ui/kit/kit";
import { lazyComponent } from "../ui/kit/lazy";
import { useScreenSettings } from "../ui/settings/Settings";
import { groups, ICONS, TITLES } from "./attention";
import { CellCard } from "./CellCard";
import type { Fleet, FleetFeed } from "./feed";
import { type Choice, dayOf } from "./results";
import "./fleet.css";

const UnitsView = lazyComponent(() => import("./UnitsView"));
const AlarmsView = lazyComponent(() => import("./AlarmsView"));

const TABS = { cells: msg`Cells`, units: msg`Units`, alarms: msg`Alarms` } as const;
type Tab = keyof typeof TABS;

/** The shown part of the page: it is in the address, so that "back" and reloading work. */
function useTab(): Tab {
  const hash = useSyncExternalStore(
    (changed) => {
      addEventListener("hashchange", changed);
      return () => removeEventListener("hashchange", changed);
    },
    () => location.hash.slice(2),
  );
  return hash in TABS ? (hash as Tab) : "cells";
}

export function FleetPage({ feed }: { feed: FleetFeed }) {
  const language = useLanguage();
  useScreenSettings();
  const tab = useTab();
  const { cards, connected, broker, loaded, needsToken } = useSyncExternalStore(feed.subscribe, feed.present);
  const [choice, setChoice] = useState<Choice>(() => ({ span: "8", day: dayOf(Date.now()), cell: "" }));
  const names = useMemo(() => [...new Set([...cards.values()].map((card) => card.name))].sort(compareTexts), [cards]);
  if (needsToken) return <Token key={language} onToken={(token) => (remember("token", token), feed.connect(token))} />;
  const view = { choice, cells: names, onChange: setChoice };
  return (
    <div className="screen" key={language}>
      <div className="fleet">
        <header className="bar">
          <h1>{t`Workplaces`}</h1>
          <nav className="fleet-tabs" aria-label={t`Parts of the page`}>
            {Object.entries(TABS).map(([id, title]) => (
              <a key={id} href={`#/${id}`} aria-current={id === tab ? "page" : undefined} className="button">
                {i18n._(title)}
              </a>
            ))}
          </nav>
          <select
            aria-label={t`Language`}
            value={language}
            onChange={({ target: { value } }) => {
              if (!isLanguage(value)) return;
              remember("language", value);
              void loadCatalogue(value);
            }}
          >
            {Object.entries(LANGUAGES).map(([id, name]) => (
              <option key={id} value={id}>
                {name}
              </option>
            ))}
          </select>
        </header>
        <main key={tab}>
          {loaded && !(connected && broker) && (
            <p className="fleet-lost" role="alert">
              <Icon name="plug" />
              {connected
                ? t`The broker is not connected, so no cell has a signal. The cells work without it.`
                : t`The server of this page is not connected, so no cell has a signal. The cells work without it.`}
            </p>
          )}
          <Suspense fallback={<Waiting>{t`Loading…`}</Waiting>}>
            {tab === "units" && <UnitsView {...view} />}
            {tab === "alarms" && <AlarmsView {...view} />}
          </Suspense>
          {tab === "cells" && <Cells cards={cards} connected={connected} loaded={loaded} />}
        </main>
      </div>
    </div>
  );
}

function Cells({ cards, connected, loaded }: Pick<Fleet, "cards" | "connected" | "loaded">) {
  const [search, setSearch] = useState("");
  const wanted = search.trim().toLowerCase();
  const shown = [...cards.values()].filter(
    ({ name, state }) => name.includes(wanted) || state.program.toLowerCase().includes(wanted),
  );
  // Without a connection to the server of the fleet, all shown states may be outdated.
  const current = connected ? shown : shown.map((card) => ({ ...card, alive: false }));
  const found = groups(current);
  return (
    <>
      {!loaded && <Waiting>{t`Loading…`}</Waiting>}
      {loaded && cards.size === 0 && (
        <p className="empty quiet">{t`No cells yet. A cell appears here when it has a name and the broker.`}</p>
      )}
      {cards.size > 0 && found.length === 0 && <p className="empty quiet">{t`No match for “${search.trim()}”.`}</p>}
      <div className="fleet-head">
        <input
          className="fleet-search"
          type="search"
          aria-label={t`Search`}
          placeholder={t`Name or program`}
          value={search}
          onChange={(event) => setSearch(event.target.value)}
        />
        <ul className="fleet-summary" aria-label={t`Summary`}>
          {found.map(([level, members]) => (
            <li key={level} data-level={level}>
              <Icon name={ICONS[level]} />
              <strong>{members.length}</strong> {i18n._(TITLES[level])}
            </li>
          ))}
        </ul>
      </div>
      {found.map(([level, members]) => (
        <section key={level} className="fleet-group" data-level={level}>
          <h2>
            {i18n._(TITLES[level])}
            <span className="hidden-but-read">{plural(members.length, { one: ": # cell", other: ": # cells" })}</span>
          </h2>
          <ul className="fleet-cards">
            {members.map((card) => (
              <CellCard key={card.id} card={card} level={level} />
            ))}
          </ul>
        </section>
      ))}
    </>
  );
}

/** Ask for the token of this screen. */
function Token({ onToken }: { onToken: (token: string) => void }) {
  const [token, setToken] = useState("");
  return (
    <form
      className="fleet-token"
      onSubmit={(event) => {
        event.preventDefault();
        if (token.trim()) onToken(token.trim());
      }}
    >
      <h1>{t`Workplaces`}</h1>
      <p>{t`A token is needed. An administrator creates one on the server of this page.`}</p>
      <label>
        {t`Token`}
        <input type="password" autoComplete="off" value={token} onChange={(event) => setToken(event.target.value)} />
      </label>
      <Button variant="primary" type="submit">{t`Show the cells`}</Button>
    </form>
  );
}
