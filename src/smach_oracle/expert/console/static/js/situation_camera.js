// The robot's cameras beside a question: what they saw at the failure, and live once somebody wants it. Side by side; on a
// phone one or the other.
import { CameraView, drawPicture } from './camera_view.js';
import { h, replace, setText } from './dom.js';
import { duration } from './format.js';

// Colour first, raw or compressed alike; depth and everything else after it.
const RANK = [/\/(rgb|color|colour)\//, /image_(raw|rect|color)/, /./];

// The cameras of a robot: those of its namespace, or all that there are.
function camerasOf(app, robot) {
  const space = robot.slice(0, robot.lastIndexOf('/') + 1);
  const sensors = ((app.store.get('eye') || {}).sensors || []).filter((each) => each.kind === 'image' && !/depth|disparity/.test(each.topic));
  const own = sensors.filter((each) => each.topic.startsWith(space));
  const rank = (each) => RANK.findIndex((pattern) => pattern.test(each.topic));
  return (own.length ? own : sensors).sort((one, other) => rank(one) - rank(other) || one.topic.localeCompare(other.topic));
}

// A frame that the console keeps, by its number.
export class StillView {
  constructor(app, still) {
    this.canvas = h('canvas', { class: 'picture', width: still.size[0], height: still.size[1], role: 'img', 'aria-label': 'Image of ' + still.topic + ' at the failure' });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Fetching it…');
    this.root = h('figure', { class: 'view camera-view still-view', 'data-topic': still.topic, 'data-still': still.id }, h('div', { class: 'screen' }, this.canvas, this.note),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, still.topic), h('span', { class: 'spacer' }), h('span', { class: 'dim' }, taken(still))));
    this.fetch(app, still);
  }

  async fetch(app, still) {
    try {
      const answer = await app.link.fetch('still/' + still.id);
      if (!answer.ok) throw new Error(answer.status === 404 ? 'It is not kept any more.' : 'It cannot be had (' + answer.status + ').');
      await drawPicture(this.canvas, answer);
      this.note.hidden = true;
      this.root.classList.add('shown');
    } catch (err) {
      setText(this.note, err instanceof TypeError ? 'The connection was lost.' : err.message);
    }
  }
}

function taken(still) {
  if (still.late === null) return 'at the failure';
  return still.late < 1 ? 'at the question' : duration(still.late) + ' after the question';
}

export class SituationCamera {
  constructor(app, question) {
    this.app = app;
    this.question = question;
    this.choice = h('select', { 'aria-label': 'Camera', onchange: () => this.look() });
    this.then = h('div', { class: 'pane then' });
    this.now = h('div', { class: 'pane now' });
    this.tabs = ['then', 'now'].map((which) => h('button', { class: 'tool', type: 'button', 'data-pane': which, onclick: () => this.turn(which) }, which === 'then' ? 'At the failure' : 'Live'));
    this.toggle = h('button', { class: 'tool', type: 'button', 'data-action': 'live-camera', onclick: () => this.setLive(!this.live) });
    this.panes = h('div', { class: 'panes' }, this.then, this.now);
    this.root = h('section', { class: 'card situation-camera' }, h('div', { class: 'row camera-head' }, h('h3', {}, 'Camera'), h('div', { class: 'row pane-tabs', role: 'group', 'aria-label': 'Which image' }, this.tabs), h('span', { class: 'spacer' }), this.choice, this.toggle), this.panes);
    this.live = false;
    this.turn('then');
    this.update();
  }

  get stills() { return (this.app.store.get('stills') || {})[this.question.key] || this.kept || []; }

  update() {
    this.kept = this.stills;
    const cameras = camerasOf(this.app, this.question.robot).map((each) => each.topic);
    const topics = [...new Set([...this.kept.map((still) => still.topic), ...cameras])];
    this.root.hidden = !topics.length;
    const shape = JSON.stringify([topics, this.kept]);
    if (shape === this.shape) return;
    this.shape = shape;
    const before = this.choice.value;
    replace(this.choice, topics.map((topic) => h('option', { value: topic, selected: topic === before }, topic)));
    this.choice.hidden = topics.length < 2;
    this.look();
  }

  // On a phone: which of the two is shown.
  turn(which) {
    this.panes.dataset.shown = which;
    for (const tab of this.tabs) tab.setAttribute('aria-pressed', tab.dataset.pane === which);
    if (which === 'now') this.setLive(true);
  }

  setLive(on) {
    this.live = on;
    this.look();
  }

  look() {
    const topic = this.choice.value;
    const still = this.kept.find((each) => each.topic === topic);
    this.panes.classList.toggle('one', !still || !this.live);
    if ((still && still.id) !== this.shownStill) {
      this.shownStill = still && still.id;
      replace(this.then, still && new StillView(this.app, still).root);
    }
    this.then.hidden = !still;
    this.now.hidden = Boolean(still) && !this.live;
    setText(this.toggle, this.live ? 'Stop live' : 'Show live');
    this.toggle.setAttribute('aria-pressed', this.live);
    if (!still && !this.live && !this.now.childElementCount) replace(this.now, h('p', { class: 'dim' }, 'What it saw at the failure is not known.'));
    const wanted = this.live ? topic : '';
    if (wanted === this.topic) return;
    this.topic = wanted;
    this.stop();
    this.view = wanted ? new CameraView(this.app, wanted) : null;
    replace(this.now, this.view && this.view.root);
    if (!this.view) this.look();
  }

  stop() { if (this.view) this.view.stop(); }
}
