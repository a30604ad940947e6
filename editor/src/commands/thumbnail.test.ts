import { beforeEach, expect, test, vi } from "vitest";
import { getState, store } from "../store/store";

const call = vi.fn();
vi.mock("../session/connection", () => ({ call, serves: () => true }));
const { loadThumbnailOnce } = await import("./thumbnail");

const TAKEN = "data:image/webp;base64,AA";

beforeEach(() => store.setState({ thumbnails: {} }));

test("a thumbnail that is stored while another answer is under way stays", async () => {
  let answer: (data: object) => void = () => {};
  call.mockReturnValue(new Promise((done) => (answer = done)));
  loadThumbnailOnce("pro_1", "10:00");
  store.setState({ thumbnails: { pro_1: { picture: TAKEN, own: false } } });
  answer({ values: {} });
  await vi.waitFor(() => expect(call).toHaveResolved());
  await Promise.resolve();
  expect(getState().thumbnails.pro_1?.picture).toBe(TAKEN);
});

test("a thumbnail is loaded", async () => {
  call.mockResolvedValue({ values: { thumbnail: TAKEN } });
  loadThumbnailOnce("pro_1", "11:00");
  await vi.waitFor(() => expect(getState().thumbnails.pro_1?.picture).toBe(TAKEN));
});
