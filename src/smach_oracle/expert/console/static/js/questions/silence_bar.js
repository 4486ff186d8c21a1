// @ts-check
// Why a question cannot be answered now: somebody who must be heard for it is silent.
import { h, setText } from '../page/dom.js';
import { aged } from '../page/liveness.js';

/** @typedef {import('../page/liveness.js').Liveness} Liveness */

export class SilenceBar {
  /**
   * @param {Liveness} liveness
   * @param {server.Question} question
   */
  constructor(liveness, question) {
    this.liveness = liveness;
    this.question = question;
    this.words = h('span', { role: 'alert' });
    this.root = h('div', { class: 'silence-bar', hidden: true }, this.words);
    this.age = h('span', { class: 'dim last-word' });
  }

  /** @returns {boolean} whether somebody is silent */
  show() {
    const who = this.liveness.whoIsSilent(this.question);
    this.root.hidden = !who;
    setText(this.words, who ? 'Nothing is heard from ' + who + ' any more. What is shown is old, '
      + 'and no answer is sent until it is heard again.' : '');
    const age = this.liveness.robot(this.question.robot);
    setText(this.age, age === null ? '' : 'heard ' + aged(age) + ' ago');
    return Boolean(who);
  }
}
