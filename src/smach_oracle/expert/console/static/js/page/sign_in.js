// @ts-check
// Who uses the page: the form that takes a token, and the dialog that takes a name.
import { h, part, replace, setText } from './dom.js';
import { remember } from './preferences.js';

/** @type {{ [status: number]: string | undefined }} */
const WORDS = { 0: 'The console does not answer.', 200: '', 401: 'There is no such token.',
  429: 'Too many tries; wait a little.' };
const ABOUT_TOKENS = 'This console takes commands to robots. Its token is in the file that it was '
  + 'started with.';
const ABOUT_NAMES = 'Your name, as robots, other experts and the records of trials have it.';

/**
 * Put the form that takes a token in the place of the panels.
 * @param {page.Connection} connection
 * @param {string | null} note what the page says of itself
 */
export function askToken(connection, note) {
  if (document.getElementById('token')) return; // what is being typed stays
  const token = h('input', { type: 'password', id: 'token', autocomplete: 'current-password',
    required: true });
  const problem = h('p', { class: 'problem', role: 'alert' });
  /** @param {SubmitEvent} event */
  const onsubmit = async (event) => {
    event.preventDefault();
    const status = await connection.signIn(token.value).catch(() => 0);
    setText(problem, WORDS[status] ?? 'Refused (' + status + ').');
  };
  replace(part('main'), h('form', { class: 'card sign-in', onsubmit },
    h('h2', {}, 'Sign in'), note && h('p', { role: 'status' }, note),
    h('p', { class: 'dim' }, ABOUT_TOKENS), h('label', { for: 'token' }, 'Token'), token, problem,
    h('button', { class: 'primary', id: 'sign-in' }, 'Sign in')));
  token.focus();
}

/**
 * @param {page.Connection} connection
 * @param {() => void} signOut
 */
export function askName(connection, signOut) {
  const { session, expert } = connection;
  if (!session) return;
  const fixed = Boolean(session.name);
  const name = h('input', { type: 'text', id: 'expert', maxlength: 60, value: expert,
    autocomplete: 'name', disabled: fixed });
  const onsubmit = () => { if (!fixed) rename(connection, name.value.trim()); };
  const out = () => { dialog.close(); signOut(); };
  /** @type {HTMLDialogElement} */
  const dialog = h('dialog', { class: 'card', 'aria-labelledby': 'name-title',
    onclose: () => dialog.remove() },
    h('form', { method: 'dialog', onsubmit },
      h('h2', { id: 'name-title' }, h('label', { for: 'expert' }, 'Your name')),
      h('p', { class: 'dim' }, fixed ? 'It goes with your token.' : ABOUT_NAMES), name,
      h('p', { class: 'dim' }, 'Role: ' + session.role),
      h('div', { class: 'row' },
        session.tokens && h('button', { type: 'button', onclick: out }, 'Sign out'),
        h('span', { class: 'spacer' }),
        h('button', { class: 'primary', id: 'save-name' }, 'Done'))));
  document.body.append(dialog);
  dialog.showModal();
  name.select();
}

/** @type {Promise<boolean> | null} */
let demanded = null;

/**
 * Ask for the name that something needs which is to be done. It covers nothing up: a hand can be
 * stopped meanwhile.
 * @param {page.Connection} connection
 * @returns {Promise<boolean>} whether it was given
 */
export function demandName(connection) {
  demanded = demanded || new Promise((resolve) => { showDemand(connection, resolve); })
    .finally(() => { demanded = null; });
  return demanded;
}

/**
 * @param {page.Connection} connection
 * @param {(given: boolean) => void} done
 */
function showDemand(connection, done) {
  const name = h('input', { type: 'text', id: 'expert', maxlength: 60, autocomplete: 'name',
    required: true, 'aria-label': 'Your name' });
  const problem = h('p', { class: 'problem', role: 'alert' });
  let given = false;
  /** @param {SubmitEvent} event */
  const onsubmit = async (event) => {
    event.preventDefault();
    if (!name.value.trim()) return;
    connection.wantedExpert = name.value.trim();
    const reply = await connection.hello().catch(() => null);
    given = Boolean(reply && reply.ok && reply.message);
    if (given) remember('expert', connection.wantedExpert);
    if (given) dialog.close();
    else setText(problem, reply ? reply.message : WORDS[0] || '');
  };
  /** @type {HTMLDialogElement} */
  const dialog = h('dialog', { class: 'card name-demand', 'aria-label': 'Your name',
    onclose: () => { dialog.remove(); done(given); },
    onkeydown: (event) => {
      if (event.key !== 'Escape') return;
      event.stopPropagation(); // it leaves the dialog alone, not what is behind it
      dialog.close();
    } },
  h('form', { onsubmit },
    h('h2', {}, 'Who are you?'), h('p', { class: 'dim' }, ABOUT_NAMES), name, problem,
    h('div', { class: 'row' },
      h('button', { type: 'button', id: 'no-name', onclick: () => dialog.close() }, 'Only look'),
      h('span', { class: 'spacer' }),
      h('button', { class: 'primary', id: 'save-name' }, 'Go on'))));
  document.body.append(dialog);
  dialog.show();
  name.focus();
}

/**
 * @param {page.Connection} connection
 * @param {string} name
 */
function rename(connection, name) {
  if (!name || name === connection.expert) return;
  connection.wantedExpert = name;
  remember('expert', name);
  connection.connect();
}
