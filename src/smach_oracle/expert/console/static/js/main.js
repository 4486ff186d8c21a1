// The frame around the panels. A panel is {id, title, create(app)}; create returns {root, update(names), shown(),
// badge()} of which all but root may be left out.
import { Alerts, remember, remembered } from './alerts.js';
import { h, replace, setText, toast } from './dom.js';
import { Link, Store } from './link.js';
import { machines } from './machines.js';
import { questions } from './questions.js';
import { sensors } from './sensors.js';
import { trials } from './trials.js';

const PANELS = [questions, machines, sensors, trials];
const STATES = { connecting: 'connecting…', connected: 'live', lost: 'connection lost – trying again', 'signed-out': 'signed out' };

class App {
  constructor() {
    this.store = new Store();
    this.alerts = new Alerts();
    this.link = new Link(this.store, (state, session) => this.onState(state, session), () => this.leave('You have signed out on another page of this browser.'));
    this.link.expert = remembered('expert', '');
    this.note = takeNote();
    this.state = 'connecting';
    this.session = null;
    this.buildTop();
    this.panels = PANELS.map((panel) => ({ panel, view: panel.create(this) }));
    this.buildNav();
    this.store.onChange((names) => this.update(names));
    setInterval(() => this.tick(), 1000);
  }

  get role() { return this.session ? this.session.role : ''; }

  get expert() { return this.session ? this.session.expert || '' : ''; }

  get mayAnswer() { return this.role === 'operator' || this.role === 'teleoperator'; }

  buildTop() {
    this.status = h('span', { id: 'status', class: 'status' });
    this.person = h('button', { id: 'person', class: 'icon-button', disabled: true, title: 'Your name, as robots and records have it', onclick: () => this.askName() });
    this.theme = h('button', { class: 'icon-button', onclick: () => this.nextTheme() });
    this.setTheme(remembered('theme', 'auto'));
    replace(document.getElementById('top'),
      h('img', { src: 'static/icon.svg', alt: '', class: 'logo' }), h('strong', { class: 'brand' }, 'Operator console'),
      this.status, h('span', { class: 'spacer' }), this.alerts.buttons(), this.theme, this.person);
  }

  buildNav() {
    this.tabs = new Map(this.panels.map(({ panel }) => {
      const badge = h('span', { class: 'badge', hidden: true });
      const button = h('button', { class: 'tab', id: 'tab-' + panel.id, onclick: () => this.show(panel.id) },
        h('span', {}, panel.title), badge);
      return [panel.id, { button, badge }];
    }));
    replace(document.getElementById('nav'), [...this.tabs.values()].map((tab) => tab.button));
  }

  show(id) {
    const entry = this.panels.find(({ panel }) => panel.id === id) || this.panels[0];
    this.current = entry.panel.id;
    for (const [name, tab] of this.tabs) tab.button.setAttribute('aria-current', name === this.current ? 'page' : 'false');
    const main = document.getElementById('main');
    if (main.firstElementChild !== entry.view.root) replace(main, entry.view.root);
    history.replaceState(null, '', '#' + this.current);
    if (entry.view.shown) entry.view.shown();
  }

  view(id) { return this.panels.find(({ panel }) => panel.id === id).view; }

  update(names) {
    if (names.includes('questions')) this.alerts.look(this.store.get('questions') || []);
    for (const { panel, view } of this.panels) {
      if (view.update) view.update(names);
      const count = view.badge ? view.badge() : 0;
      const badge = this.tabs.get(panel.id).badge;
      badge.hidden = !count;
      setText(badge, count);
    }
  }

  tick() {
    for (const { panel, view } of this.panels) if (view.tick && panel.id === this.current) view.tick();
  }

  onState(state, session) {
    this.state = state;
    this.session = session;
    setText(this.status, STATES[state]);
    this.status.dataset.state = state;
    document.body.dataset.link = state;
    setText(this.person, session && session.expert ? session.expert + (this.mayAnswer ? '' : ' (viewer)') : 'Name');
    this.person.hidden = state === 'signed-out';
    this.person.disabled = !session;
    if (state === 'signed-out') this.askToken();
    if (state === 'connected') {
      if (!document.getElementById('main').contains(this.view(this.current || 'questions').root)) this.show(location.hash.slice(1));
      for (const { view } of this.panels) if (view.connected) view.connected();
    }
  }

  askToken() {
    if (document.getElementById('token')) return; // what is being typed stays
    const token = h('input', { type: 'password', id: 'token', autocomplete: 'current-password', required: true });
    const problem = h('p', { class: 'problem', role: 'alert' });
    const form = h('form', { class: 'card sign-in', onsubmit: async (event) => {
      event.preventDefault();
      const status = await this.link.signIn(token.value).catch(() => 0);
      setText(problem, { 0: 'The console does not answer.', 200: '', 401: 'There is no such token.',
        429: 'Too many tries; wait a little.' }[status] ?? 'Refused (' + status + ').');
    } }, h('h1', {}, 'Sign in'), this.note && h('p', { role: 'status' }, this.note), h('p', { class: 'dim' }, 'This console takes commands to robots. Its token is in the file that it was started with.'),
    h('label', { for: 'token' }, 'Token'), token, problem, h('button', { class: 'primary', id: 'sign-in' }, 'Sign in'));
    this.note = null;
    replace(document.getElementById('main'), form);
    token.focus();
  }

  askName() {
    if (!this.session) return;
    const name = h('input', { type: 'text', id: 'expert', maxlength: 60, value: this.expert, autocomplete: 'name' });
    const fixed = Boolean(this.session.name);
    name.disabled = fixed;
    const dialog = h('dialog', { class: 'card', onclose: () => dialog.remove() },
      h('form', { method: 'dialog', onsubmit: () => {
        if (fixed || name.value.trim() === this.expert || !name.value.trim()) return;
        this.link.expert = name.value.trim();
        remember('expert', this.link.expert);
        this.link.fail();
        this.link.connect();
      } }, h('h2', {}, 'Your name'), h('p', { class: 'dim' }, fixed ? 'It goes with your token.' : 'As robots, other experts and the records of trials have it. Whoever has the same name is the same expert.'),
      name, h('p', { class: 'dim' }, 'Role: ' + this.role), h('div', { class: 'row' },
        this.session.tokens && h('button', { type: 'button', onclick: () => { dialog.close(); this.signOut(); } }, 'Sign out'),
        h('span', { class: 'spacer' }), h('button', { class: 'primary', id: 'save-name' }, 'Done'))));
    document.body.append(dialog);
    dialog.showModal();
    name.select();
  }

  async signOut() {
    if (await this.link.signOut()) this.leave('You have signed out.');
    else this.say('The console does not answer: you are still signed in.', 'bad');
  }

  // Begin anew: nothing of what the person saw or typed stays on the page.
  leave(why) {
    leaveNote(why);
    location.reload();
  }

  nextTheme() {
    this.setTheme({ auto: 'light', light: 'dark', dark: 'auto' }[document.documentElement.dataset.theme]);
  }

  setTheme(theme) {
    document.documentElement.dataset.theme = ['light', 'dark'].includes(theme) ? theme : 'auto';
    remember('theme', document.documentElement.dataset.theme);
    setText(this.theme, { auto: '◐ Auto', light: '○ Light', dark: '● Dark' }[document.documentElement.dataset.theme]);
    this.theme.title = 'Colours: dark, light, or as the system has them';
  }

  say(text, kind) { toast(text, kind); }
}

// What the page says of itself after it has begun anew.
function leaveNote(text) {
  try { sessionStorage.setItem('note', text); } catch (err) { /* it may be refused; a comfort only */ }
}

function takeNote() {
  try {
    const text = sessionStorage.getItem('note');
    sessionStorage.removeItem('note');
    return text;
  } catch (err) { return null; }
}

const app = new App();
app.link.connect();
