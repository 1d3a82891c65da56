// @ts-check
/** What shows a session once there are files: fetched after the page can be used. */

import { RunsComparison } from "./comparison/comparison.js";
import { showComparison } from "./comparison/view.js";
import { showDevices } from "./extraction/device-view.js";
import { showExtraction } from "./extraction/view.js";
import { showDoctor } from "./files/doctor.js";
import { showGuide } from "./guide.js";
import { showResults } from "./results/results.js";
import { showViewer } from "./viewer/viewer.js";

/**
 * @param {import("./session.js").Session} session
 * @param {import("./extraction/device-extractor.js").DeviceExtractor} devices
 * @param {boolean} isGuided whether a new visitor is shown around
 */
export function showViews(session, devices, isGuided) {
  showDoctor(session);
  showExtraction(session);
  showDevices(session, devices);
  showResults(session);
  showViewer(session);
  showComparison(session, new RunsComparison(session));
  if (isGuided) showGuide(session);
}
