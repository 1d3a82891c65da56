// @ts-check
/** Files for the user, made here. */

/**
 * @param {string} name
 * @param {string} type
 * @param {BlobPart} content
 */
export function save(name, type, content) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  // The browser has taken hold of the content when the click returns, but not every one at once.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
