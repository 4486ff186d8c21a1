// @ts-check
// A question of a trial that is replayed, its answer, and what cameras gave when it was put.
import { h, replace } from '../page/dom.js';
import { chip } from '../page/format.js';
import { keep, redrawWith } from '../page/redraw.js';
import { FailureImageView } from '../sensors/failure_image_view.js';

export class ReplayQuestion {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.root = h('div', { class: 'replay-question', hidden: true });
    /** @type {server.KeptImage[]} */
    this.images = [];
    this.imagesRoot = h('div', { class: 'replay-images' });
  }

  /**
   * @param {replay.AskedQuestion | null} question
   * @param {server.KeptImage[]} images
   */
  show(question, images) {
    this.root.hidden = !question;
    if (!question) return;
    const { state, reason, holder, steps, answer } = question;
    redrawWith(this.root, question, () => [h('div', { class: 'replay-words-of-question' },
      h('p', {}, h('strong', {}, 'Question about ', state), reason && ': ' + reason,
        holder && !answer && [' ', chip(holder + ' works on it', 'warn')]),
      steps.map((step) => h('p', { class: 'dim' }, step)), answerOf(question)),
    this.showImages(images)]);
  }

  /**
   * They are asked for once.
   * @param {server.KeptImage[]} images
   */
  showImages(images) {
    if (!images.length) return null;
    if (this.images !== images) {
      this.images = images;
      replace(this.imagesRoot, images.map((image) => new FailureImageView(this.app, image).root));
    }
    return keep(this.imagesRoot);
  }
}

/** @param {replay.AskedQuestion} question */
function answerOf({ answer, closed }) {
  if (!answer) {
    return h('p', { class: 'dim' }, closed ? 'No answer: ' + closed + '.' : 'Not answered yet.');
  }
  return h('p', { class: 'replay-answer' }, h('strong', {}, 'Answer'),
    answer.by && ' of ' + answer.by, ': ', answer.kind.replace('_', ' '),
    answer.target && ' ' + answer.target,
    answer.why && h('span', { class: 'dim' }, ' – ' + answer.why));
}
