// @ts-check
/** What was thrown: its message, and what the package says of its cause. */

/**
 * What is wrong with the input, as data: `type` names the fault, the other members depend on it.
 * @typedef {{ type: string, [member: string]: unknown }} Reason
 */

/** @param {unknown} error */
export function messageOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/**
 * The cause of an error of the package, where it gives one.
 * @param {unknown} error
 * @returns {Reason | null}
 */
export function reasonOf(error) {
  return /** @type {{ reason?: Reason }} */ (error)?.reason ?? null;
}
