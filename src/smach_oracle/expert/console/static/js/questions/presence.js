// @ts-check
// Tells the console that the person who holds a question is still at it.

const PAUSE_MS = 5000; // between two that are told
const PRESSES = ['pointerdown', 'keydown', 'wheel'];

/**
 * Begin: once a page.
 * @param {page.App} app
 * @param {() => string} held the question that this page holds, '' for none
 */
export function tellPresses(app, held) {
  let told = { question: '', atMs: -Infinity };
  const tell = () => {
    const question = held();
    const nowMs = performance.now();
    const again = told.question === question && nowMs - told.atMs < PAUSE_MS;
    if (!question || again || !app.connection.connected) return;
    told = { question, atMs: nowMs };
    app.connection.request('pressed', { question }).catch(() => {});
  };
  for (const kind of PRESSES) window.addEventListener(kind, tell, { capture: true, passive: true });
}
