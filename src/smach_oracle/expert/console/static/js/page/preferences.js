// @ts-check
// What this browser remembers. It may refuse to, as private windows do: it is a comfort only.

const NOTE = 'note';

/**
 * @param {string} name
 * @param {string} otherwise
 */
export function remembered(name, otherwise) {
  try {
    return localStorage.getItem(name) ?? otherwise;
  } catch (err) {
    return otherwise;
  }
}

/**
 * @param {string} name
 * @param {string} value
 */
export function remember(name, value) {
  try { localStorage.setItem(name, value); } catch (err) { /* refused */ }
}

/**
 * Keep what the page must say after it has begun again.
 * @param {string} text
 */
export function leaveNote(text) {
  try { sessionStorage.setItem(NOTE, text); } catch (err) { /* refused */ }
}

export function takeNote() {
  try {
    const text = sessionStorage.getItem(NOTE);
    sessionStorage.removeItem(NOTE);
    return text;
  } catch (err) {
    return null;
  }
}
