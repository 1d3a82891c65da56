/**
 * Extraction of keypoints on WebGPU, for browsers; works in a page and in its workers.
 *
 * A GPU may compute wrongly without saying so. Compare a frame with `Encoder` of the package before you trust it; other
 * kernels add up in another order, so that keypoints differ by some 1e-6.
 */

/** Loads the module once; later calls return the same promise. */
export default function init(module?: WebAssembly.Module | BufferSource | URL | string | Response): Promise<void>;

/** The GPU that the browser prefers for speed, open. */
export class Gpu {
  private constructor();
  /** Opens the GPU: once in a page or worker, a second call is rejected. Rejected too when the browser gives none. */
  static open(): Promise<Gpu>;
  /** Moves the encoder of a checkpoint (`.safetensors`, `.pth` or `.bpk`) to the GPU; `name` is for messages. */
  encoder(bytes: Uint8Array, name: string): GpuEncoder;
  free(): void;
}

/** The encoder of a checkpoint, on the GPU. */
export class GpuEncoder {
  private constructor();
  /**
   * Decodes an image (PNG, JPEG, WebP) and resizes it to the encoder's input. Throws when it cannot be decoded, is too small
   * for the encoder, or too large for the GPU.
   */
  prepare(image: Uint8Array, name: string): GpuFrame;
  /**
   * The keypoints of frames, in their order, with an `Error` in the place of a frame that has none. The frames are used up.
   * Rejected when the GPU failed, e.g. was lost: what it computes then cannot be trusted. Calls may overlap, so that frames are
   * prepared while others are computed.
   */
  extract(frames: GpuFrame[]): Promise<(GpuExtraction | Error)[]>;
  free(): void;
}

/** A frame, decoded and resized. */
export class GpuFrame {
  private constructor();
  /** As many frames like this one fit the limits of the GPU together. */
  readonly batchLimit: number;
  free(): void;
}

/** One frame's keypoints. */
export interface GpuExtraction {
  /** N x 2, latent space. */
  points: Float64Array;
  /** Of the image. */
  width: number;
  height: number;
}
