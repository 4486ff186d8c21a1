// @ts-check
// What a camera gave when a question was put: an image that the server keeps.
import { ConnectionLost } from '../page/connection.js';
import { h, setText } from '../page/dom.js';
import { duration } from '../page/format.js';
import { drawImage, imageCanvas } from './image_canvas.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../server').KeptImage} KeptImage */

export class FailureImageView {
  /**
   * @param {App} app
   * @param {KeptImage} image
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
      h('span', { class: 'spacer' }), h('span', { class: 'dim' }, whenTaken(image))));
    this.fetch(app, id);
  }

  /**
   * @param {App} app
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
    this.note.hidden = !problem;
    this.root.classList.toggle('shown', !problem);
  }
}

/** @param {KeptImage} image */
function whenTaken({ late }) {
  if (late === null) return 'at the failure';
  return late < 1 ? 'at the question' : duration(late) + ' after the question';
}
