// @ts-check
// Lists that change in place. What is pressed stays under the pointer until it is let go: around it
// nothing comes or goes meanwhile, so that a click that has begun is not lost, nor lands elsewhere.
import { keyOf, listenAs, nodesOf } from './dom.js';

const CLICK_MS = 100; // by then the click of what was let go has come
const PRESSED = 'button, summary, [role="button"], .mark, .event';
/** @type {WeakMap<Element, string>} */
const drawn = new WeakMap(); // of what
/** @type {WeakMap<Node, Element>} */
const kept = new WeakMap(); // by what stands for it in a view
/** @type {WeakSet<Node>} */
const own = new WeakSet(); // those that are kept: never matched with another element
/** @type {Map<Element, () => void>} */
const waiting = new Map(); // by element, its newest change
/** @type {Element | null} */
let pressed = null;
let timer = 0;

/**
 * What stands in a view for an element that is not made again: the view must not take it out of the
 * page, where it may have the focus.
 * @param {Element} element
 */
export function keep(element) {
  const place = document.createElement('template');
  kept.set(place, element);
  own.add(element);
  return place;
}

/**
 * An element becomes like a view of its kind, which was made again: this is how a panel changes.
 * @param {Element} element
 * @param {Element} view
 */
export function render(element, view) { whenLetGo(element, () => { alike(element, view); }); }

/**
 * As if the element's children were replaced by these, which were made again; but those that are
 * there become like them, each like the one of its kind and `key`. Those that stay are not taken
 * out, not even for a moment: that would cost them focus and scroll position, and the click that
 * has begun on them.
 * @param {Element} element
 * @param {...page.Child} children
 */
export function redraw(element, ...children) {
  whenLetGo(element, () => {
    const nodes = nodesOf(children).map((node) => kept.get(node) || node);
    const stay = new Set(nodes);
    /** @type {Map<string, ChildNode[]>} */
    const before = new Map();
    for (const node of element.childNodes) {
      if (stay.has(node) || own.has(node)) continue;
      const same = before.get(nameOf(node));
      if (same) same.push(node);
      else before.set(nameOf(node), [node]);
    }
    put(element, nodes.map((node) => {
      if (node.parentNode === element || own.has(node)) return node;
      const old = (before.get(nameOf(node)) || []).shift();
      return old ? alike(old, node) : fillPlaces(node);
    }));
    // as options leave the select of a view, that one chooses others
    const chosen = element instanceof HTMLSelectElement && element.querySelector('[selected]');
    if (chosen instanceof HTMLOptionElement && !chosen.selected) chosen.selected = true;
  });
}

/**
 * A part of a view that comes in as it is, with the elements that it keeps.
 * @param {Node} node
 */
function fillPlaces(node) {
  if (node instanceof Element) {
    for (const place of node.querySelectorAll('template')) {
      const element = kept.get(place);
      if (element) place.replaceWith(element);
    }
  }
  return node;
}

/**
 * The same where what it is drawn of is other data than last time: long lists take a while.
 * @param {Element} element
 * @param {unknown} data
 * @param {() => page.Child} childrenOf
 * @returns {boolean} whether it is
 */
export function redrawWith(element, data, childrenOf) {
  const other = isOther(element, data);
  if (other) redraw(element, childrenOf());
  return other;
}

/**
 * The same of a view.
 * @param {Element} element
 * @param {unknown} data
 * @param {() => Element} viewOf
 */
export function renderWith(element, data, viewOf) {
  if (isOther(element, data)) render(element, viewOf());
}

/** An element for each of many things, which changes only where something about that one does. */
export class Cards {
  /** @param {() => Element} begin an empty one */
  constructor(begin) {
    this.begin = begin;
    /** @type {Map<string, Element>} */
    this.known = new Map(); // by key
  }

  /**
   * What stands for one in a view.
   * @param {string} key
   * @param {unknown} data
   * @param {() => Element} viewOf
   */
  card(key, data, viewOf) {
    const card = this.known.get(key) || this.begin();
    this.known.set(key, card);
    renderWith(card, data, viewOf);
    return keep(card);
  }

  /** @param {string[]} keys of those that there still are */
  only(keys) {
    const there = new Set(keys);
    for (const key of this.known.keys()) if (!there.has(key)) this.known.delete(key);
  }
}

/**
 * @param {Element} element
 * @param {unknown} data
 */
function isOther(element, data) {
  const text = JSON.stringify(data);
  if (drawn.get(element) === text) return false;
  drawn.set(element, text);
  return true;
}

/**
 * @param {Element} element
 * @param {Node[]} nodes
 */
function put(element, nodes) {
  const wanted = new Set(nodes);
  for (const node of [...element.childNodes]) if (!wanted.has(node)) node.remove();
  let at = element.firstChild;
  for (const node of wanted) {
    if (node !== at && node.parentNode === element && node.contains(document.activeElement)) {
      while (at && at !== node) { // it keeps the focus; those before it move
        const next = at.nextSibling;
        element.append(at);
        at = next;
      }
    }
    if (at && node === at) at = at.nextSibling;
    else element.insertBefore(node, at);
  }
}

/** @param {Node} node */
function nameOf(node) { return node.nodeName + ' ' + keyOf(node); }

/**
 * A node that is there, made like another one of its kind.
 * @param {Node} old
 * @param {Node} fresh
 */
function alike(old, fresh) {
  if (old instanceof Text && fresh instanceof Text) {
    if (old.data !== fresh.data) old.data = fresh.data;
  } else if (old instanceof Element && fresh instanceof Element) {
    copyAttributes(fresh, old);
    listenAs(old, fresh);
    redraw(old, [...fresh.childNodes]);
  }
  return old;
}

/**
 * @param {Element} from
 * @param {Element} to
 */
function copyAttributes(from, to) {
  for (const { name } of [...to.attributes]) {
    // a person has opened it, or the page has noted how long it lies there
    const stays = name === 'open' || (name === 'data-settled'
      && from.hasAttribute('data-deliberate'));
    if (!stays && !from.hasAttribute(name)) to.removeAttribute(name);
  }
  for (const { name, value } of from.attributes) {
    if (to.getAttribute(name) === value) continue;
    if (name === 'style' && (to instanceof HTMLElement || to instanceof SVGElement)) {
      to.style.cssText = value; // the page's policy allows no other way
    } else to.setAttribute(name, value);
  }
  if (from instanceof HTMLInputElement && to instanceof HTMLInputElement) {
    to.checked = from.checked; // the attribute says how it was at first
  }
}

/**
 * Change what is in an element, unless something in it is pressed: then as soon as that is let go.
 * @param {Element} element
 * @param {() => void} change
 */
export function whenLetGo(element, change) {
  waiting.delete(element);
  if (pressed && element.contains(pressed)) waiting.set(element, change);
  else change();
}

function letGo() {
  clearTimeout(timer);
  pressed = null;
  const changes = [...waiting.values()];
  waiting.clear();
  for (const change of changes) change();
}

window.addEventListener('pointerdown', (event) => {
  letGo();
  const main = !event.button && event.target instanceof Element;
  pressed = main ? event.target.closest(PRESSED) : null;
}, true);
window.addEventListener('click', letGo, true);
for (const type of ['pointerup', 'pointercancel']) {
  window.addEventListener(type, () => {
    clearTimeout(timer); // of another finger
    timer = setTimeout(letGo, CLICK_MS);
  }, true);
}
window.addEventListener('blur', letGo);
