// @ts-check
// The arrow keys of a tree whose parts are all open: up and down, to a part's parent or its first
// child, to either end. Enter and Space choose, since its parts are buttons.

const PART = '[role="treeitem"]';

/** @param {HTMLElement} tree */
export function takeArrowKeys(tree) {
  tree.addEventListener('keydown', (event) => {
    const parts = /** @type {HTMLElement[]} */ ([...tree.querySelectorAll(PART)]);
    const at = parts.findIndex((part) => part === document.activeElement);
    if (at < 0 || event.ctrlKey || event.altKey || event.metaKey) return;
    const to = whereTo(event.key, parts, at);
    if (to === null) return;
    event.preventDefault();
    event.stopPropagation();
    parts[Math.max(0, Math.min(to, parts.length - 1))].focus();
  });
}

/**
 * Index of the part that a key leads to; null for another key.
 * @param {string} key
 * @param {HTMLElement[]} parts
 * @param {number} at index of the one that has the focus
 */
function whereTo(key, parts, at) {
  switch (key) {
    case 'ArrowDown': return at + 1;
    case 'ArrowUp': return at - 1;
    case 'Home': return 0;
    case 'End': return parts.length - 1;
    case 'ArrowLeft': return parentOf(parts, at);
    case 'ArrowRight': return isParent(parts, at) ? at + 1 : at;
    default: return null;
  }
}

/** @param {HTMLElement} part */
function levelOf(part) { return Number(part.getAttribute('aria-level')); }

/**
 * @param {HTMLElement[]} parts
 * @param {number} at
 */
function parentOf(parts, at) {
  for (let i = at - 1; i >= 0 && parts[i].parentElement === parts[at].parentElement; i -= 1) {
    if (levelOf(parts[i]) < levelOf(parts[at])) return i;
  }
  return at;
}

/**
 * @param {HTMLElement[]} parts
 * @param {number} at
 */
function isParent(parts, at) {
  const next = parts[at + 1];
  return Boolean(next) && next.parentElement === parts[at].parentElement
    && levelOf(next) > levelOf(parts[at]);
}
