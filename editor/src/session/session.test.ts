import { beforeEach, expect, test, vi } from "vitest";

const call = vi.fn();
vi.mock("./connection", () => ({ call, serves: (request: string) => request === "GetViewState" }));

const { Session } = await import("./session");
const { now, setConnection } = await import("../store/store");

beforeEach(() => {
  vi.stubGlobal("window", new EventTarget());
  vi.stubGlobal("document", new EventTarget());
});

test("what a user sees and changes is never replaced by the stored view state", async () => {
  const answers: ((values: object) => void)[] = [];
  call.mockImplementation((request: string) => {
    if (request === "GetViewState") return new Promise((resolve) => answers.push((values) => resolve({ values })));
    return Promise.resolve(request === "SystemInfo" ? { supported_rpc_requests: [] } : []);
  });
  const client = { stop: vi.fn(), start: vi.fn(), reconnectNow: vi.fn() };
  new Session(client as never);
  setConnection({ user: "Olga" });
  (client as never as { onState: (state: string, reason: string, code: number) => void }).onState("open", "", 0);
  await vi.waitFor(() => expect(answers).toHaveLength(2));
  await new Promise((resolve) => setTimeout(resolve));
  expect(now().connection.status).toBe("joining");
  for (const answer of answers) answer({ dismissed_run: 3 });
  await vi.waitFor(() => expect(now().connection.status).toBe("ready"));
  expect(now().view.general).toEqual({ dismissed_run: 3 });
  await new Promise((resolve) => setTimeout(resolve));
  expect(answers, "requested again while the user may change it").toHaveLength(2);
});
