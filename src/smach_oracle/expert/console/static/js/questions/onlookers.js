// @ts-check
// Who else looks at a question now.

const PAUSE_MS = 1000; // turning the pages fast uses up no limit on commands
const ELSEWHERE = ' (in another browser)';
let wanted = ''; // the question that this page shows
let timer = 0;

/**
 * Tell the others which question this page shows.
 * @param {page.App} app
 * @param {string} question '' for none
 */
export function lookAt({ connection }, question) { // the timer holds nothing of what is shown
  wanted = question;
  timer = timer || setTimeout(() => {
    timer = 0;
    connection.request('view', { question: wanted }).catch(() => {});
  }, PAUSE_MS);
}

/**
 * This page shows a question no longer; it may show another one.
 * @param {page.App} app
 * @param {string} question
 */
export function lookAway(app, question) { if (wanted === question) lookAt(app, ''); }

/**
 * The others who look at a question, each browser once.
 * @param {page.App} app
 * @param {string} key
 */
export function namesOf(app, key) {
  const all = app.store.get('onlookers')?.[key] || [];
  const others = new Map(all.filter(({ session }) => session !== app.connection.browser)
    .map((each) => [each.session + ' ' + each.name, nameOf(app, each)]));
  return [...others.values()];
}

/**
 * The names of the others who look at a question, in short.
 * @param {page.App} app
 * @param {string} key
 */
export function readersOf(app, key) {
  return namesOf(app, key).map((name) => name.replace(ELSEWHERE, ''));
}

/**
 * @param {page.App} app
 * @param {server.Onlooker} onlooker
 */
function nameOf(app, { name, role }) {
  if (name) return name + (name === app.expert ? ELSEWHERE : '');
  return role === 'viewer' ? 'a viewer' : 'somebody without a name';
}
