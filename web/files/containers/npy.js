// @ts-check
/** A frame as a numpy array, for the screen; the extraction reads the same bytes itself. */

export const NPY_TYPE = "application/x-npy";

/** @type {Record<string, (view: DataView, at: number) => number>} From an element to 0 to 255. */
const ELEMENTS = {
  "|u1": (view, at) => view.getUint8(at),
  "<f4": (view, at) => 255 * view.getFloat32(at, true),
  ">f4": (view, at) => 255 * view.getFloat32(at, false),
  "<f8": (view, at) => 255 * view.getFloat64(at, true),
  ">f8": (view, at) => 255 * view.getFloat64(at, false),
};

/**
 * Whether a file is a numpy array, by its first bytes.
 * @param {Uint8Array} head
 */
export function isArray(head) {
  return [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59].every((byte, i) => head[i] === byte);
}

/**
 * @param {Blob} blob an array of shape (height, width, 3) or (3, height, width), with a header as
 * numpy writes it
 * @returns {Promise<ImageData>}
 */
export async function imageOfArray(blob) {
  const view = new DataView(await blob.arrayBuffer());
  const start = 10 + view.getUint16(8, true);
  const header = new TextDecoder().decode(new Uint8Array(view.buffer, 10, start - 10));
  const type = /'descr': '([^']+)'/.exec(header)?.[1] ?? "";
  const shape = (/'shape': \(([^)]*)\)/.exec(header)?.[1] ?? "").split(",").map(Number);
  const element = ELEMENTS[type];
  const planes = shape[0] === 3 && shape[2] !== 3;
  const [height, width] = planes ? shape.slice(1) : shape;
  if (!element || !height || !width) throw new Error(`no frame: ${header}`);
  const size = Number(type.slice(2));
  const [pixel, channel] = planes ? [size, size * width * height] : [3 * size, size];
  const image = new ImageData(width, height);
  for (let i = 0; i < width * height; i++) {
    for (let c = 0; c < 3; c++)
      image.data[4 * i + c] = element(view, start + i * pixel + c * channel);
    image.data[4 * i + 3] = 255;
  }
  return image;
}

/**
 * Pixels as a numpy array of shape (height, width, 3), which the extraction takes.
 * @param {ImageData} image
 */
export function arrayOfPixels({ data, width, height }) {
  const text = `{'descr': '|u1', 'fortran_order': False, 'shape': (${height}, ${width}, 3), }`;
  const rgb = new Uint8Array(width * height * 3);
  for (let from = 0, to = 0; from < data.length; from += 4) {
    rgb[to++] = data[from];
    rgb[to++] = data[from + 1];
    rgb[to++] = data[from + 2];
  }
  const magic = Uint8Array.of(
    0x93,
    0x4e,
    0x55,
    0x4d,
    0x50,
    0x59,
    1,
    0,
    text.length & 255,
    text.length >> 8,
  );
  return new Blob([magic, text, rgb], { type: NPY_TYPE });
}
