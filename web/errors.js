// @ts-check
/** What was thrown. */

/** @param {unknown} error */
export function messageOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/**
 * What an error of the package is about.
 * @param {unknown} error
 */
export function kindOf(error) {
  return /** @type {{ kind?: string }} */ (error)?.kind;
}
