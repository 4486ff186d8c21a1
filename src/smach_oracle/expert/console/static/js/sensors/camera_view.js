// A camera, live: colour, or depth in false colours with its range.
import { h, setText } from './dom.js';
import { FrameFeed, numberOf } from './frame_feed.js';

export class CameraView {
  constructor(app, topic, type, width) {
    this.canvas = h('canvas', { class: 'picture', width: 4, height: 3, role: 'img', 'aria-label': 'Image of ' + topic });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the first image…');
    this.range = h('span', { class: 'view-range' });
    this.rate = h('span', { class: 'dim number' });
    this.root = h('figure', { class: 'view camera-view', 'data-topic': topic }, h('div', { class: 'screen' }, this.canvas, this.note, this.range),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic), h('span', { class: 'spacer' }), this.rate));
    this.feed = new FrameFeed(app, () => numberOf(app, topic, type), this.root, { width, take: (answer, facts) => this.take(answer, facts), say: (text) => this.say(text) });
  }

  stop() { this.feed.stop(); }

  say(text) {
    setText(this.note, text);
    this.note.hidden = !text;
    this.root.classList.toggle('stale', Boolean(text));
    setText(this.rate, this.feed && this.feed.rate ? this.feed.rate.toFixed(1) + ' /s' : '');
  }

  async take(answer, facts) {
    await drawPicture(this.canvas, answer);
    setText(this.range, facts.range ? 'red ' + facts.range[0].toFixed(2) + ' m … blue ' + facts.range[1].toFixed(2) + ' m' : '');
    this.root.classList.add('shown');
  }
}

// Put the picture of an answer on a canvas, which takes its size, or the one given.
export async function drawPicture(canvas, answer, size) {
  const bitmap = await createImageBitmap(await answer.blob());
  const [width, height] = size || [bitmap.width, bitmap.height];
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  canvas.getContext('2d').drawImage(bitmap, 0, 0, width, height);
  bitmap.close();
}
