// @ts-check
/** A plot as a file. */

import { drawLines, linesToSvg } from "../pkg/index.js";
import { save } from "../ui/download.js";
import { describe, objectName } from "./trajectory.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./trajectory.js").Colors} Colors
 * @typedef {import("./trajectory.js").Quantity} Quantity
 */

const SAVED = { width: 720, height: 320, fontSize: 14, pixels: 3 };

/** For print, whatever the scheme of the page. @type {Colors} */
const PRINT = {
  truth: "#1b1f24",
  keypoint: "#d0342c",
  transformed: "#1f6feb",
  error: "#1f6feb",
  foreground: "#1b1f24",
  background: "#ffffff",
  grid: "#e3e7eb",
};

/**
 * @param {Session} session
 * @param {Quantity} quantity
 * @param {"svg" | "png"} format
 */
export async function savePlot(session, quantity, format) {
  const plot = describe(
    session,
    quantity,
    PRINT,
    SAVED.fontSize * (format === "png" ? SAVED.pixels : 1),
  );
  if (!plot) return;
  const figure = { ...plot.figure, cursor: null };
  const sequence = session.score.sequenceOf(session.score.selection.frame)?.name;
  const file = `${objectName(session)}-${quantity}-${sequence}.${format}`.replace(/[^\w.-]+/g, "_");
  if (format === "svg") {
    save(file, "image/svg+xml", linesToSvg(figure, SAVED.width, SAVED.height));
    return;
  }
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: SAVED.width * SAVED.pixels, height: SAVED.height * SAVED.pixels });
  drawLines(canvas, figure);
  /** @type {Blob | null} */
  const image = await new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  if (image) save(file, "image/png", image);
}
