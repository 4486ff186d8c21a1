// @ts-check
// Who did what and when, how long it took, and the notes for the next shift.
import { h } from '../page/dom.js';
import { clock, duration } from '../page/format.js';
import { keep, redrawWith, render } from '../page/redraw.js';

/** @type {page.Panel} */
export const people = { id: 'people', title: 'People', create: (app) => new PeoplePanel(app) };

const COLUMNS = ['Who', 'Answered', 'Until claimed', 'Until answered', 'Until it went on'];
const IN_MEMORY = 'They are kept until this console ends. Its setting ~shift_file keeps them in a '
  + 'file.';
const LOST = 'The connection was lost: whether the note is kept is not known.';

class PeoplePanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.text = h('textarea', { rows: 3, maxlength: 2000, 'aria-label': 'A note for the next shift',
      placeholder: 'What the next shift must know' });
    this.problem = ''; // with the last note
    this.search = h('input', { type: 'search', placeholder: 'Search', 'aria-label': 'Search acts',
      oninput: () => this.showActs() });
    this.acts = h('tbody', {});
    this.root = h('div', {});
  }

  get sections() { return /^(?:people|acts)$/; }

  draw() {
    this.text.disabled = !this.app.mayAnswer;
    render(this.root, this.view(this.app.store.get('people')));
    this.showActs();
  }

  /** @param {server.People | undefined} found */
  view(found) {
    const { mayAnswer } = this.app;
    return h('div', { class: 'panel people' },
      h('section', { class: 'card' }, h('h2', {}, 'For the next shift'),
        h('form', { class: 'note-form', onsubmit: (event) => this.write(event) }, keep(this.text),
          h('p', { class: 'problem', role: 'alert' }, this.problem), h('div', { class: 'row' },
            h('button', { class: 'primary', type: 'submit', disabled: !mayAnswer },
              'Leave the note'))),
        h('div', { class: 'notes' }, found
          && notesOf(found, mayAnswer, (note) => this.send('drop_note', { note })))),
      h('section', { class: 'card', 'aria-label': 'Shifts' }, h('h2', {}, 'Shifts'),
        found && shiftsOf(found)),
      h('section', { class: 'card acts' }, h('h2', {}, 'Who did what'), keep(this.search),
        h('div', { class: 'table-frame', tabindex: 0 }, h('table', {}, h('thead', {}, h('tr', {},
          ['When', 'Who', 'What', 'Robot', 'Result'].map((title) => (
            h('th', { scope: 'col' }, title))))), keep(this.acts)))));
  }

  showActs() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const acts = this.app.store.get('acts')?.acts || [];
    redrawWith(this.acts, [acts, words], () => acts.filter((act) => words.every((word) => (
      [act.who, act.what, act.robot, act.message, act.role].join(' ').toLowerCase().includes(word)
    ))).map(actRow));
  }

  /** @param {SubmitEvent} event */
  async write(event) {
    event.preventDefault();
    const { value } = this.text;
    if (value.trim() && await this.send('write_note', { text: value })) this.text.value = '';
  }

  /**
   * @template {'write_note' | 'drop_note'} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   * @returns {Promise<boolean>} whether it is done
   */
  async send(name, args) {
    const { ok, message } = await this.app.connection.ask(name, args, LOST);
    this.problem = ok ? '' : message;
    this.draw();
    return ok;
  }
}

/**
 * @param {server.People} section
 * @param {boolean} mayDrop
 * @param {(id: string) => void} drop
 * @returns {page.Child}
 */
function notesOf({ notes, kept, problem }, mayDrop, drop) {
  return [problem && h('p', { key: 'problem', class: 'problem' }, problem),
    !kept && h('p', { key: 'memory', class: 'dim' }, IN_MEMORY),
    !notes.length && h('p', { key: 'none', class: 'dim' }, 'No notes.'),
    notes.map(({ id, at, who, text }) => h('article', { key: id, class: 'shift-note' },
      h('p', { class: 'row' }, h('strong', {}, who), h('span', { class: 'dim' }, moment(at)),
        h('span', { class: 'spacer' }), mayDrop && h('button', { class: 'tool', type: 'button',
          'data-deliberate': 'drop note ' + id, onclick: () => drop(id) }, 'Done with it')),
      h('p', { class: 'words' }, text)))];
}

/**
 * @param {server.People} section
 * @returns {page.Child}
 */
function shiftsOf({ shifts, since, kept }) {
  if (!shifts.length) {
    return h('p', { key: 'none', class: 'dim' }, 'Nobody has answered a question'
      + (kept ? '.' : ' since this console began (' + moment(since) + ').'));
  }
  return h('div', { key: 'table', class: 'table-frame', tabindex: 0 }, h('table', {},
    h('caption', {}, 'Mean, and the longest in brackets'),
    h('thead', {}, h('tr', {}, COLUMNS.map((title) => h('th', { scope: 'col' }, title)))),
    shifts.map(({ begin, people: rows }) => h('tbody', { key: String(begin) },
      h('tr', {}, h('th', { colspan: COLUMNS.length, scope: 'rowgroup' },
        'Shift from ' + moment(begin))), rows.map(shiftRow)))));
}

/** @param {server.ShiftRow} row */
function shiftRow({ who, answered, claim, answer, resume }) {
  return h('tr', { key: who }, h('th', { scope: 'row' }, who || 'somebody'),
    h('td', { class: 'number' }, answered),
    [claim, answer, resume].map((times) => h('td', { class: 'number' }, timesWords(times))));
}

/** @param {server.Times | null} times */
function timesWords(times) {
  return times ? duration(times[0]) + ' (' + duration(times[1]) + ')' : '–';
}

/** @param {server.Act} act */
function actRow({ id, at, who, role, client, what, robot, ok, message, console: name }) {
  return h('tr', { key: id, title: 'at ' + client + ', by ' + name },
    h('td', { class: 'number' }, moment(at)),
    h('td', {}, who || 'nobody', h('span', { class: 'dim' }, role && ' ' + role)),
    h('td', {}, what), h('td', {}, robot),
    h('td', { class: ok ? '' : 'refused' }, ok ? message || 'done' : 'refused: ' + message));
}

/** @param {number} at s since the epoch */
function moment(at) {
  const day = new Date(at * 1000).toDateString();
  return (day === new Date().toDateString() ? '' : day.slice(0, -5) + ', ') + clock(at);
}
