// @ts-check
/** A canvas of the size that it is shown in. */

/**
 * Gives a canvas the shape of an image and the pixels of the display; `null` while it is not shown.
 * @param {HTMLCanvasElement} canvas
 * @param {{ width: number, height: number }} size
 */
export function fit(canvas, size) {
  canvas.style.aspectRatio = `${size.width} / ${size.height}`;
  canvas.style.maxWidth = `calc(var(--stage-height) * ${size.width / size.height})`;
  const scale = window.devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
    Math.round(side * scale),
  );
  if (width === 0 || height === 0) return null;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return canvas.getContext("2d");
}
