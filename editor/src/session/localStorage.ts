/** The data stored by this browser: user, token, language, display settings. All other data is on the server. */

const KEYS = {
  name: "arcor2-hw.name",
  token: "arcor2-hw.token",
  names: "arcor2-hw.names",
  theme: "arcor2-hw.theme",
  hand: "arcor2-hw.left-handed",
  language: "arcor2-hw.language",
  /** Focal lengths of the cameras of this device. */
  lenses: "arcor2-hw.lenses",
  /** The poses at which users placed the workplace by hand in AR, by camera. */
  placements: "arcor2-hw.placements",
};

export function remembered(key: keyof typeof KEYS): string {
  try {
    return localStorage.getItem(KEYS[key]) ?? "";
  } catch {
    return ""; // private windows of some browsers refuse it
  }
}

export function remember(key: keyof typeof KEYS, value: string): void {
  try {
    if (value) localStorage.setItem(KEYS[key], value);
    else localStorage.removeItem(KEYS[key]);
  } catch {
    // as above
  }
}

/** Number of remembered users. */
const MAX_USERS = 6;

/** Return the users who joined with this browser, newest first. */
export function recentUsers(): string[] {
  return remembered("names").split("\n").filter(Boolean);
}

export function rememberUser(name: string): void {
  remember("names", [name, ...recentUsers().filter((each) => each !== name)].slice(0, MAX_USERS).join("\n"));
}

/** Move a token from the address, where it would be visible, to the storage of the browser. */
export function takeTokenFromAddress(): void {
  const url = new URL(location.href);
  const token = url.searchParams.get("token");
  if (!token) return;
  remember("token", token);
  url.searchParams.delete("token");
  history.replaceState(null, "", url);
}
