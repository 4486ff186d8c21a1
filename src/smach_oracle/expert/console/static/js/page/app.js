// @ts-check
// The frame around the panels: the top bar, the tabs, and which panel is shown.
import { addressOf, readAddress } from './address.js';
import { Alerts } from './alerts.js';
import { Connection } from './connection.js';
import { watchOverClicks } from './deliberate.js';
import { h, part, replace, setText, toast } from './dom.js';
import { letTimePass } from './format.js';
import { Gate } from './gate.js';
import { Liveness, aged } from './liveness.js';
import { leaveNote, remember, remembered, takeNote } from './preferences.js';
import { Looking } from './row_lists.js';
import { keysButton } from './shortcuts.js';
import { askName, askToken, demandName } from './sign_in.js';
import { Store } from './store.js';

/** @typedef {import('./connection.js').State} State */
/** @typedef {'auto' | 'light' | 'dark'} Theme */

/** @type {{ [state in State]: string }} */
const STATES = { connecting: 'connecting…', connected: 'live', 'signed-out': 'signed out',
  lost: 'connection lost – trying again' };
const RECONNECT_AFTER_S = 22; // of silence: the connection may lead nowhere
/** @type {Set<keyof server.Commands>} */
const UNTOLD = new Set(['hello', 'watch', 'look', 'view', 'pressed', 'release', 'drive']);
/** @type {{ [theme in Theme]: { words: string, dark: string, next: Theme } }} dark: its media */
const THEMES = {
  auto: { words: '◐ Auto', dark: '(prefers-color-scheme: dark)', next: 'light' },
  light: { words: '○ Light', dark: 'not all', next: 'dark' },
  dark: { words: '● Dark', dark: 'all', next: 'auto' },
};

/** @implements {page.App} */
export class App {
  /** @param {page.Panel[]} panels the first one is shown at first */
  constructor(panels) {
    this.store = new Store();
    this.liveness = new Liveness(this.store);
    this.alerts = new Alerts();
    this.connection = new Connection(this.store, (state) => this.onState(state),
      () => this.leave('You have signed out on another page of this browser.'),
      (command, limit) => this.sayNoReply(command, limit));
    this.connection.gate = new Gate(this.liveness, () => Boolean(this.expert),
      () => this.nameOneself());
    this.connection.wantedExpert = remembered('expert', '');
    this.looking = new Looking(this.connection, () => (
      this.current === 'trials' || this.current === 'people' ? this.current : ''));
    this.note = takeNote();
    this.current = '';
    this.status = h('span', { id: 'status', class: 'status' });
    this.ages = h('span', { id: 'ages', class: 'ages dim',
      title: 'How long ago they were heard' });
    this.person = h('button', { id: 'person', class: 'icon-button', disabled: true,
      title: 'Your name, as robots and records have it', onclick: () => this.askName() });
    /** @type {Theme} */
    this.theme = 'auto';
    this.themeButton = h('button', { class: 'icon-button',
      title: 'Colours: dark, light, or as the system has them',
      onclick: () => this.setTheme(THEMES[this.theme].next) });
    this.buildTop();
    this.tabs = panels.map((panel) => this.tab(panel));
    replace(part('nav'), this.tabs.map((tab) => tab.button));
    this.store.onChange((names) => this.update(names));
    setInterval(() => this.tick(), 1000);
    window.addEventListener('popstate', () => { if (this.showsPanel) this.arrive(); });
    watchOverClicks();
  }

  get role() { return this.connection.session ? this.connection.session.role : ''; }

  get expert() { return this.connection.expert; }

  get mayAnswer() { return this.role === 'operator' || this.role === 'teleoperator'; }

  /** @param {server.Question} question */
  isMine({ holder, session }) {
    return Boolean(holder) && holder === this.expert && session === this.connection.browser;
  }

  buildTop() {
    const theme = remembered('theme', 'auto');
    this.setTheme(theme === 'light' || theme === 'dark' ? theme : 'auto');
    replace(part('top'), h('img', { src: 'static/icon.svg', alt: '', class: 'logo' }),
      h('h1', { class: 'brand' }, 'Operator console'), this.status, this.ages,
      h('span', { class: 'spacer' }), this.alerts.buttons(), keysButton(),
      this.themeButton, this.person);
  }

  /** @param {page.Panel} panel */
  tab({ id, title, create }) {
    const badge = h('span', { class: 'badge', hidden: true });
    const button = h('button', { class: 'tab', id: 'tab-' + id, onclick: () => {
      this.show(id);
      this.went();
    } },
      h('span', {}, title), badge);
    return { id, view: create(this), button, badge };
  }

  /** @param {string} id */
  show(id) {
    const shown = this.tabs.find((tab) => tab.id === id) || this.tabs[0];
    this.current = shown.id;
    for (const tab of this.tabs) {
      tab.button.setAttribute('aria-current', tab === shown ? 'page' : 'false');
    }
    const main = part('main');
    if (main.firstElementChild !== shown.view.root) replace(main, shown.view.root);
    this.looking.tell();
    shown.view.draw();
    shown.view.shown?.();
  }

  /** The tab that is shown. */
  get tabNow() { return this.tabs.find((tab) => tab.id === this.current) || this.tabs[0]; }

  /** Whether a panel is shown, and not the sign-in. */
  get showsPanel() { return part('main').contains(this.tabNow.view.root); }

  went() {
    const address = addressOf(this.current, this.tabNow.view.place || '');
    if (address === location.hash) return;
    try {
      history.pushState(null, '', address);
    } catch (err) { /* browsers refuse too many in a short time */ }
  }

  /** Show what the address names. */
  arrive() {
    const { panel, place } = readAddress(location.hash);
    this.show(panel);
    this.tabNow.view.goTo?.(place);
  }

  /** @param {string[]} names of sections */
  update(names) {
    if (names.includes('questions')) this.alerts.look(this.store.questions, this.store.now());
    for (const { id, view, badge } of this.tabs) {
      const wanted = id === this.current || view.always;
      if (wanted && names.some((name) => view.sections.test(name))) view.draw(names);
      const count = view.badge ? view.badge() : 0;
      badge.hidden = !count;
      setText(badge, count);
    }
  }

  tick() {
    this.showLife();
    if (this.store.get('questions')) this.alerts.look(this.store.questions, this.store.now());
    if (this.connection.connected && this.liveness.console > RECONNECT_AFTER_S) {
      this.connection.connect();
    }
    letTimePass(part('main'), this.store.now());
    this.tabNow.view.draw();
  }

  /** Whether what is shown is live: said in the top bar; the styles grey what is not. */
  showLife() {
    const { connection, liveness } = this;
    const state = connection.state;
    const silent = state === 'connected' ? liveness.silent : '';
    const age = silent === 'master' ? liveness.master : liveness.console;
    setText(this.status, silent ? silent + ' silent for ' + aged(age) : STATES[state]);
    this.status.dataset['state'] = silent ? 'silent' : state;
    document.body.dataset['connection'] = state;
    document.body.dataset['silent'] = silent;
    setText(this.ages, state === 'connected' ? liveness.ages() : '');
  }

  /**
   * @param {keyof server.Commands} command
   * @param {number} limit s
   */
  sayNoReply(command, limit) {
    if (UNTOLD.has(command)) return;
    toast('No reply within ' + limit + ' s to “' + command.replace(/_/g, ' ')
      + '”: whether it was carried out is not known.', 'bad');
  }

  /** Ask for the name that is needed first; whether it was given. */
  async nameOneself() {
    const given = await demandName(this.connection);
    this.showPerson();
    return given;
  }

  showPerson() {
    const name = this.expert && this.expert + (this.mayAnswer ? '' : ' (viewer)');
    setText(this.person, name || 'Your name?');
  }

  /** @param {State} state */
  onState(state) {
    if (state === 'connected') this.liveness.begin();
    this.showLife();
    this.showPerson();
    this.person.hidden = state === 'signed-out';
    this.person.disabled = !this.connection.session;
    if (state === 'signed-out') {
      askToken(this.connection, this.note);
      this.note = null;
    }
    if (state === 'connected') this.begin();
  }

  /** The connection is there: so are the panels. */
  begin() {
    this.looking.connected();
    if (!this.showsPanel) this.arrive();
    for (const { view } of this.tabs) view.connected?.();
  }

  askName() { askName(this.connection, () => this.signOut()); }

  async signOut() {
    if (await this.connection.signOut()) this.leave('You have signed out.');
    else toast('The console does not answer: you are still signed in.', 'bad');
  }

  /**
   * Begin again: nothing of what the person saw or typed stays on the page.
   * @param {string} why
   */
  leave(why) {
    leaveNote(why);
    location.reload();
  }

  /** @param {Theme} theme */
  setTheme(theme) {
    this.theme = theme;
    part('dark').setAttribute('media', THEMES[theme].dark);
    remember('theme', theme);
    setText(this.themeButton, THEMES[theme].words);
  }
}
