// @ts-check
/** Buttons that copy what an element shows. */

import { announce, h } from "./dom.js";

/** How long a button says that it has copied. */
const COPIED_MS = 2000;

/**
 * @param {string} id
 * @param {string} label
 * @param {HTMLElement} shown its text is copied
 * @param {() => Promise<void>} prepare fills it
 */
export function copyButton(id, label, shown, prepare) {
  const text = h("span", {}, label);
  const copy = async () => {
    await prepare();
    try {
      await navigator.clipboard.writeText(shown.textContent ?? "");
      text.textContent = "Copied";
      announce("Copied.");
      setTimeout(() => (text.textContent = label), COPIED_MS);
    } catch {
      // Without leave to write to the clipboard, the text is ready to be copied by hand.
      getSelection()?.selectAllChildren(shown);
    }
  };
  return h("button", { id, type: "button", class: "button", onclick: () => void copy() }, text);
}
