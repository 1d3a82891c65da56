// @ts-check
/** The worker of `inside.js`: its own instance of the package, one checkpoint. */

import { messageOf } from "../errors.js";
import { decodable } from "../extraction/decodable.js";
import init, { Decoder, Encoder } from "../pkg/index.js";

/** The page ends this worker when the checkpoint changes. @type {Encoder | undefined} */
let encoder;
/** @type {Decoder | undefined} */
let decoder;

self.onmessage = async (/** @type {MessageEvent<import("./inside.js").Question>} */ { data }) => {
  self.postMessage(await answer(data));
};

/**
 * @param {import("./inside.js").Question} question
 * @returns {Promise<import("./inside.js").Answer>}
 */
async function answer(question) {
  const { checkpoint } = question;
  try {
    await init(["extraction"]);
    if (question.kind === "heat") {
      const { frame, keypoint } = question;
      encoder ??= new Encoder(await bytesOf(checkpoint), checkpoint.path);
      const map = encoder.heatMap(
        await decodable(await bytesOf(frame), frame.path),
        frame.path,
        keypoint,
      );
      const { width, height, weights } = map;
      map.free();
      return { map: { width, height, weights } };
    }
    decoder ??= Decoder.open(await bytesOf(checkpoint), checkpoint.path);
    if (!decoder) throw new Error(`${checkpoint.path} holds an encoder only`);
    const image = new ImageData(decoder.width, decoder.height);
    image.data.set(decoder.reconstruct(question.points));
    return { image };
  } catch (error) {
    return { problem: messageOf(error) };
  }
}

/** @param {import("./inside.js").Given} source */
async function bytesOf({ path, blob }) {
  try {
    return new Uint8Array(await blob.arrayBuffer());
  } catch {
    throw new Error(
      `${path} can no longer be read: it was changed or removed after it was dropped; drop it ` +
        "again",
    );
  }
}
