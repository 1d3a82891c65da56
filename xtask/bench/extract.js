// The pool of the page and onnxruntime-web by turns, over the same frames. Ours is timed from
// encoded images to keypoints; onnxruntime-web, which decodes nothing, from pixels that are ready.
import * as ort from "/peers/onnxruntime-web/dist/ort.wasm.min.mjs";
import { WorkerPool } from "/extraction/pool.js";
import { fetchExample } from "/files/example.js";

const ROUNDS = Number(new URLSearchParams(location.search).get("rounds") ?? 5);
const FRAMES = 24;
const CASES = ["basic", "keynet"].flatMap((name) => [128, 256].map((side) => [name, side]));

const blobOf = async (path) => (await fetch(path)).blob();

/** Frames of the example at this size, encoded and as planes of floats. */
async function framesOf(side) {
  const { sources } = await fetchExample(() => {});
  const images = sources.filter(({ path }) => path.endsWith(".png"));
  const canvas = new OffscreenCanvas(side, side);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const frames = [];
  for (const { path, blob } of images.slice(0, FRAMES)) {
    context.drawImage(await createImageBitmap(blob), 0, 0, side, side);
    const { data } = context.getImageData(0, 0, side, side);
    const planes = new Float32Array(3 * side * side);
    for (let i = 0; i < planes.length; i++) {
      const channel = Math.floor(i / (side * side));
      planes[i] = data[4 * (i % (side * side)) + channel] / 255;
    }
    frames.push({ source: { path, blob: await canvas.convertToBlob() }, planes });
  }
  return frames;
}

async function measured([name, side]) {
  const file = `/made/${name}-${side}`;
  const frames = await framesOf(side);
  const encoder = await new WorkerPool().open({ path: name, blob: await blobOf(`${file}.safetensors`) });
  const session = await ort.InferenceSession.create(`${file}.onnx`, { executionProviders: ["wasm"] });

  const ours = async () => {
    const points = [];
    await encoder.extract({
      frames: frames.map(({ source }) => source),
      signal: new AbortController().signal,
      onFrame: (_, extracted) => points.push(extracted.points),
      onFailure: (path, message) => {
        throw new Error(`${path}: ${message}`);
      },
    });
    return points;
  };
  const theirs = async () => {
    const points = [];
    for (const { planes } of frames) {
      const { keypoints } = await session.run({ image: new ort.Tensor("float32", planes, [1, 3, side, side]) });
      points.push(keypoints.data);
    }
    return points;
  };
  const timed = async (run) => {
    const start = performance.now();
    await run();
    return (performance.now() - start) / FRAMES;
  };
  // The first one of each loads, packs and grows.
  const [z, x] = [await ours(), await theirs()];
  const difference = Math.max(...z.flatMap((points, t) => [...points].map((v, i) => Math.abs(v - x[t][i]))));
  const times = [];
  for (let round = 0; round < ROUNDS; round++) times.push([await timed(ours), await timed(theirs)]);
  encoder.free();
  await session.release();
  return { name: `${name} ${side}`, difference, times };
}

/** Milliseconds until a checkpoint of the paper's size, with its decoder, is ready to extract with. */
async function opened(file) {
  const blob = await blobOf(`/made/${file}`);
  const times = [];
  for (let round = 0; round < ROUNDS; round++) {
    const start = performance.now();
    const encoder = await new WorkerPool().open({ path: file, blob });
    times.push(performance.now() - start);
    encoder.free();
  }
  return { file, mebibytes: blob.size / 2 ** 20, times };
}

async function results() {
  if (!crossOriginIsolated) throw new Error("the page is not isolated, so onnxruntime-web has one thread only");
  ort.env.wasm.numThreads = navigator.hardwareConcurrency;
  const cases = [];
  for (const one of CASES) cases.push(await measured(one));
  const checkpoints = [];
  for (const ending of ["safetensors", "pth"]) checkpoints.push(await opened(`keynet-256.${ending}`));
  return { cores: navigator.hardwareConcurrency, cases, checkpoints };
}

const body = await results().catch((error) => ({ error: String(error) }));
await fetch("/result", { method: "POST", body: JSON.stringify(body) });
