// @ts-check
// Elements made of plain text: whatever a robot says is a text node, never markup.

const SVG = 'http://www.w3.org/2000/svg';
const TOAST_MS = 6000;
const MOST_KEPT = 3; // texts that are announced; the oldest go
// what steers a terminal, turns the reading direction, or cannot be seen
const UNSEEN = new RegExp('[\\u0000-\\u0008\\u000b-\\u001f\\u007f-\\u009f\\u00ad\\u200b-\\u200f'
  + '\\u2028-\\u202e\\u2060-\\u206f\\ufeff\\ufff9-\\ufffb]', 'g');
/** @type {WeakMap<Node, string>} */
const keys = new WeakMap();
/** @typedef {(event: Event) => void} Listener */
/** @type {WeakMap<Node, Map<string, Listener>>} */
const listeners = new WeakMap(); // by the type of event

/** @param {unknown} text */
function clean(text) {
  return String(text).replace(UNSEEN, '\ufffd');
}

/**
 * The `key` that an element was made with, '' where it has none.
 * @param {Node} node
 */
export function keyOf(node) { return keys.get(node) || ''; }

/**
 * @template {HTMLElement | SVGElement} Made
 * @param {Made} element
 * @param {page.Properties} properties
 * @param {page.Child[]} children
 */
function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined) continue;
    if (typeof value === 'function') {
      listen(element, name.slice(2), /** @type {Listener} */ (value));
    } else if (name === 'key') keys.set(element, String(value));
    else setAttribute(element, name, value);
  }
  element.append(...nodesOf(children));
  return element;
}

/**
 * @param {Node} element
 * @param {string} type
 * @param {Listener} listener in place of the one that it had
 */
function listen(element, type, listener) {
  const own = listeners.get(element) || new Map();
  listeners.set(element, own);
  if (!own.has(type)) element.addEventListener(type, (event) => own.get(type)(event));
  own.set(type, listener);
}

/**
 * An element hears what another one of its kind was made to hear, and nothing else.
 * @param {Node} element
 * @param {Node} other
 */
export function listenAs(element, other) {
  const wanted = listeners.get(other) || new Map();
  for (const type of listeners.get(element)?.keys() || []) {
    if (!wanted.has(type)) listen(element, type, () => {});
  }
  for (const [type, listener] of wanted) listen(element, type, listener);
}

/**
 * @param {HTMLElement | SVGElement} element
 * @param {string} name
 * @param {string | number | boolean} value aria says true and false, else the attribute is there
 *   or not
 */
function setAttribute(element, name, value) {
  const there = typeof value === 'boolean' && !name.startsWith('aria-');
  if (there && !value) return;
  if (name.startsWith('--')) element.style.setProperty(name, String(value));
  else element.setAttribute(name, there ? '' : clean(value));
}

/**
 * @param {page.Child[]} children
 * @returns {Node[]}
 */
export function nodesOf(children) {
  return children.flatMap((child) => {
    if (Array.isArray(child)) return nodesOf(child);
    if (child === null || child === undefined || child === false) return [];
    return [child instanceof Node ? child : document.createTextNode(clean(child))];
  });
}

/**
 * An element: h('button', {class: 'x', onclick: f, '--hue': 3}, 'text', other elements).
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {page.Properties} properties
 * @param {...page.Child} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function h(tag, properties, ...children) {
  return fill(document.createElement(tag), properties, children);
}

/**
 * A choice of one value.
 * @param {page.Properties} properties
 * @param {[value: string, words: string | undefined][]} options
 * @param {string} chosen
 * @param {(value: string) => void} choose
 */
export function pick(properties, options, chosen, choose) {
  return h('select', { ...properties, onchange: ({ target }) => {
    if (target instanceof HTMLSelectElement) choose(target.value);
  } }, options.map(([value, words]) => (
    h('option', { key: value, value, selected: value === chosen }, words))));
}

/**
 * An element of a drawing.
 * @template {keyof SVGElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {page.Properties} properties
 * @param {...page.Child} children
 * @returns {SVGElementTagNameMap[Tag]}
 */
export function svg(tag, properties, ...children) {
  return fill(document.createElementNS(SVG, tag), properties, children);
}

/**
 * @param {Element} element
 * @param {...page.Child} children
 */
export function replace(element, ...children) {
  element.replaceChildren(...nodesOf(children));
}

/**
 * Change an element only where its content differs, so that selections and scroll positions stay.
 * @param {Element} element
 * @param {string | number} text
 */
export function setText(element, text) {
  const cleaned = clean(text);
  if (element.textContent !== cleaned) element.textContent = cleaned;
}

/**
 * An element of index.html.
 * @param {string} id
 */
export function part(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error('the page has no ' + id);
  return found;
}

/**
 * @param {string} text
 * @param {string} kind
 */
export function toast(text, kind) {
  const toasts = part('toasts');
  for (const before of [...toasts.children]) if (before.textContent === text) before.remove();
  const shown = h('div', { class: 'toast ' + kind }, text);
  shown.addEventListener('click', () => shown.remove());
  toasts.append(shown);
  setTimeout(() => shown.remove(), TOAST_MS);
}

/**
 * Say something to those who hear the page instead of looking at it, once what is being said has
 * ended.
 * @param {string} text
 */
export function announce(text) {
  const region = part('announcer');
  region.append(h('p', {}, text)); // a new element is said, too, where its text is an old one
  while (region.childElementCount > MOST_KEPT) region.firstElementChild?.remove();
}

/**
 * Whether keys that are pressed there are text.
 * @param {EventTarget | null} target
 */
export function typing(target) {
  return target instanceof HTMLElement
    && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName));
}

/** Whether a key is pressed together with another one that gives it a meaning of its own.
 * @param {KeyboardEvent} event */
export function modified(event) { return event.ctrlKey || event.metaKey || event.altKey; }
