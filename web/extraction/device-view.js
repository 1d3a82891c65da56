// @ts-check
/** What extracts the keypoints, and why; the choice between the CPU and the GPU. */

import { announce, byId, fill, h, notice, prose } from "../ui/dom.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./device-extractor.js").Choice} Choice
 * @typedef {import("./device-extractor.js").DeviceExtractor} DeviceExtractor
 */

/** @type {[Choice, string][]} */
const CHOICES = [
  ["automatic", "Automatic: the faster one"],
  ["cpu", "CPU"],
  ["gpu", "GPU (WebGPU)"],
];

/**
 * @param {Session} session
 * @param {DeviceExtractor} devices
 */
export function showDevices(session, devices) {
  const place = byId("devices");
  const line = h("p", { id: "device-verdict", class: "device-verdict" });
  const loss = h("div", {});
  const select = h(
    "select",
    {
      id: "device-choice",
      onchange: () => {
        devices.choice = /** @type {Choice} */ (select.value);
      },
    },
    ...CHOICES.map(([value, label]) =>
      h("option", { value, selected: value === devices.choice }, label),
    ),
  );
  fill(
    place,
    h("h2", { id: "devices-title" }, "Extraction runs on"),
    h("label", { class: "visually-hidden", for: "device-choice" }, "Device of the extraction"),
    select,
    line,
    loss,
  );
  let told = "";
  const update = () => {
    const { verdict, choice, lost } = devices;
    place.hidden = session.extraction === null;
    const device = verdict?.device ?? "";
    Object.assign(place.dataset, { device, choice, reason: verdict?.reason ?? "", lost });
    fill(line, ...(verdict ? prose(`${device.toUpperCase()}: ${verdict.reason}.`) : []));
    line.hidden = verdict === null;
    if (lost === told) return;
    told = lost;
    if (lost) announce(lost);
    const dismiss = () => devices.tellLoss("");
    fill(loss, lost && notice("warning", lost, { dismiss }));
  };
  devices.addEventListener("change", update);
  session.addEventListener("files", update);
  update();
}
