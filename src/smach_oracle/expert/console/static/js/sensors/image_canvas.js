// @ts-check
// Images on canvases.
import { h } from '../page/dom.js';

/**
 * @param {string} topic
 * @param {string} [when]
 */
export function imageCanvas(topic, when = '') {
  return h('canvas', { class: 'image', width: 4, height: 3, role: 'img',
    'aria-label': 'Image of ' + topic + when });
}

/**
 * Put the image of an answer on a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {Response} answer
 * @param {[width: number, height: number]} [size] px that the canvas takes; else those of the image
 */
export async function drawImage(canvas, answer, size) {
  const bitmap = await createImageBitmap(await answer.blob());
  const [width, height] = size || [bitmap.width, bitmap.height];
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  canvas.getContext('2d')?.drawImage(bitmap, 0, 0, width, height);
  bitmap.close();
}
