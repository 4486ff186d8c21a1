// @ts-check
// The address of what is shown: #PANEL, or #PANEL/PLACE. A place is what the panel calls it, such
// as the key of a question. Slashes stay, and a space is a plus.

/**
 * @param {string} panel
 * @param {string} place '' for the panel as it opens by itself
 */
export function addressOf(panel, place) {
  const words = encodeURIComponent(place).replace(/%2F/g, '/').replace(/%20/g, '+');
  return '#' + panel + (place && '/' + words);
}

/**
 * What an address names; a place that is not written as one is ''.
 * @param {string} hash
 */
export function readAddress(hash) {
  const [panel, ...rest] = hash.replace(/^#/, '').split('/');
  try {
    return { panel, place: decodeURIComponent(rest.join('/').replace(/\+/g, ' ')) };
  } catch (err) {
    return { panel, place: '' };
  }
}
