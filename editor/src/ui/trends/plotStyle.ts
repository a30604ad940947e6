/** Colours and axes of plots, in the theme of the page. */

import type UPlot from "uplot";

interface PlotStyle {
  /** Return the value of a colour, such as `--line`. */
  colour: (name: string) => string;
  axis: UPlot.Axis;
}

/** Return the style of plots in an element. */
export function plotStyle(element: Element): PlotStyle {
  const style = getComputedStyle(element);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const line = { stroke: colour("--line"), width: 1 };
  return { colour, axis: { stroke: colour("--ink-2"), grid: line, ticks: line, font: `12px ${style.fontFamily}` } };
}
