// @ts-check
// What a camera gave when a question was put: an image that the server keeps.
import { ConnectionLost } from '../page/connection.js';
import { h, setText } from '../page/dom.js';
import { duration } from '../page/format.js';
import { drawImage, imageCanvas } from './image_canvas.js';

const FAR_S = 10;

export class FailureImageView {
  /**
   * @param {page.App} app
   * @param {server.KeptImage} image
   */
  constructor(app, image) {
    const { id, topic, size: [width, height] } = image;
    this.canvas = imageCanvas(topic, ' at the failure');
    Object.assign(this.canvas, { width, height });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Fetching it…');
    this.root = h('figure', { class: 'view camera-view failure-image', 'data-topic': topic,
      'data-image': id },
    h('div', { class: 'screen' }, this.canvas, this.note),
    h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic),
      h('span', { class: 'spacer' }), h('span', { class: isFar(image) ? 'image-age old' : 'dim' },
        whenTaken(image))));
    this.fetch(app, id);
  }

  /**
   * @param {page.App} app
   * @param {number} id
   */
  async fetch(app, id) {
    let problem = '';
    try {
      const answer = await app.connection.fetch('image/' + id);
      if (answer.ok) await drawImage(this.canvas, answer);
      else if (answer.status === 404) problem = 'It is not kept any more.';
      else problem = 'It cannot be had (' + answer.status + ').';
    } catch (err) {
      const lost = err instanceof TypeError || err instanceof ConnectionLost;
      problem = err instanceof Error && !lost ? err.message : 'The connection was lost.';
    }
    setText(this.note, problem);
    this.root.classList.toggle('shown', !problem);
  }
}

/** @param {server.KeptImage} image */
function whenTaken({ late, stamped }) {
  if (late === null) return 'at the failure';
  const when = Math.abs(late) < 1 ? 'at the question'
    : duration(Math.abs(late)) + (late < 0 ? ' before' : ' after') + ' the question';
  return stamped ? when : 'came ' + when + ', without a stamp';
}

/**
 * Whether it may show something else than the failure.
 * @param {server.KeptImage} image
 */
function isFar({ late, stamped }) {
  return late !== null && (!stamped || Math.abs(late) > FAR_S);
}
