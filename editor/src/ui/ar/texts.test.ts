import { expect, test } from "vitest";
import type { Ar } from "../../store/ui";
import { adviceOf, gradeOf, qualityOf } from "./texts";

const GOOD: Ar = {
  phase: "registered",
  mode: "camera",
  pictures: true,
  drifted: false,
  touched: 0,
  stopButton: false,
  frozen: false,
  markers: false,
  grade: "good",
  error: 0.004,
  used: [10, 11, 12],
  contradicting: [],
  undecided: false,
  checked: true,
  seenAt: 100_000,
  loss: "unseen",
  corrected: 0,
  configured: 3,
  sensor: false,
  nudge: null,
  placing: false,
  camera: null,
  startedAt: 0,
};

test("the quality has error, markers and age", () => {
  expect(qualityOf(GOOD, 112_000)).toBe("±4 mm, 3 markers, 12 s ago");
  expect(qualityOf({ ...GOOD, used: [10], error: 0.0003 }, 100_400)).toBe("±1 mm, 1 marker, now");
  expect(qualityOf({ ...GOOD, checked: false, error: 0.0502 }, 100_000)).toBe("±50 mm, unchecked, 3 markers, now");
  expect(qualityOf({ ...GOOD, used: [], touched: 3, error: 0.0081 }, 160_000)).toBe("±8 mm, 3 points, 60 s ago");
  // After a correction by hand, no error is known.
  const nudge = { distance: 0.012, angle: -0.0175 };
  expect(qualityOf({ ...GOOD, nudge }, 100_000)).toBe("12 mm, 1°, 3 markers, now");
});

test("every grade has a word and a shape", () => {
  const states: Partial<Ar>[] = [
    {},
    { grade: "fair" },
    { grade: "rough" },
    { phase: "lost" },
    { phase: "looking" },
    { frozen: true },
    { phase: "hand" },
    { nudge: { distance: 0.012, angle: 0 } },
    { phase: "tracked" },
    { phase: "tracked", touched: 3 },
    { phase: "lost", mode: "tablet" },
  ];
  const grades = states.map((each) => gradeOf({ ...GOOD, ...each }));
  expect(new Set(grades.map(({ word }) => word)).size).toBe(states.length);
  expect(new Set(grades.map(({ shape }) => shape)).size).toBe(states.length);
});

test.each([
  [{}, ""],
  [{ phase: "looking", configured: 0 }, "Press Place to place the workplace by hand."],
  [{ phase: "hand" }, "The overlay does not follow the camera. Hold the device still."],
  [{ phase: "hand", sensor: true }, "The overlay turns with the device. After a step, place it again."],
  [{ phase: "looking", mode: "headset" }, "Press Touch points, then touch three corners of markers."],
  [
    { phase: "looking", mode: "headset", configured: 0 },
    "Look at a surface, and press Place. The device then tracks its own position.",
  ],
  [
    { phase: "looking", mode: "tablet", pictures: false },
    "The browser gives AR no pictures of markers. Press Place, or start again with the camera only.",
  ],
  [{ phase: "hand", mode: "tablet" }, "The device tracks its own position. Check the overlay from time to time."],
  [{ phase: "lost", mode: "tablet" }, "The device has lost its position. Move it slowly, in good light."],
  [{ phase: "tracked", mode: "tablet", drifted: true }, "The position drifts as you move. Show a marker again."],
  [
    { phase: "tracked", mode: "headset", drifted: true, touched: 3, used: [] },
    "The position drifts as you move. Touch the points again.",
  ],
  [
    { phase: "tracked", mode: "headset", grade: "rough", touched: 3, used: [] },
    "The touched points are close to each other. Configure markers that are farther apart.",
  ],
  [{ phase: "tracked", mode: "tablet", used: [10], grade: "rough" }, "Show a second marker."],
  [{ phase: "looking" }, "Point the camera at a marker."],
  [{ phase: "lost", loss: "dark" }, "It is too dark for the camera. Switch on the light."],
  [{ phase: "lost", loss: "blurred" }, "The picture is blurred. Move more slowly."],
  [{ used: [10], grade: "rough", checked: false }, "Show a second marker."],
  [{ checked: false }, "The lens is not known yet. Walk around the markers with two or more in view."],
  [{ contradicting: [12] }, "Marker 12 is not where it should be, and is left out. Measure it again."],
  [
    { used: [10, 11], undecided: true },
    "Markers 10, 11 contradict each other. Show another marker, or measure them again.",
  ],
  [{ corrected: 0.035 }, "The overlay was corrected by 35 mm."],
] as [Partial<Ar>, string][])("%j: what to do", (state, advice) => {
  expect(adviceOf({ ...GOOD, ...state })).toBe(advice);
});
