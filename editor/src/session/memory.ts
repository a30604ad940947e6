/** What this browser remembers: who uses it, the token, and how it likes the screen. The rest is kept by the server. */

const KEYS = {
  name: "arcor2-hw.name",
  token: "arcor2-hw.token",
  names: "arcor2-hw.names",
  theme: "arcor2-hw.theme",
  hand: "arcor2-hw.left-handed",
};

export function remembered(key: keyof typeof KEYS): string {
  try {
    return localStorage.getItem(KEYS[key]) ?? "";
  } catch {
    return ""; // private windows of some browsers
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

/** So many people of one tablet are remembered. */
const PEOPLE = 6;

/** Who has come in with this browser, the last first. */
export function peopleHere(): string[] {
  return remembered("names").split("\n").filter(Boolean);
}

export function rememberPerson(name: string): void {
  remember("names", [name, ...peopleHere().filter((each) => each !== name)].slice(0, PEOPLE).join("\n"));
}

/** Take a token out of the address, where it would be seen and kept, into memory. */
export function takeTokenFromAddress(): void {
  const url = new URL(location.href);
  const token = url.searchParams.get("token");
  if (!token) return;
  remember("token", token);
  url.searchParams.delete("token");
  history.replaceState(null, "", url);
}
